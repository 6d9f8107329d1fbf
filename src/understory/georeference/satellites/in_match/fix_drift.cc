#include "understory/georeference/satellites/in_match/fix_drift.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "understory/georeference/georeference_constants.h"

namespace understory {

using namespace georeference_constants::fix_drift;

using Eigen::Vector3d;

void FixDrift::add_pose(const Vector3d& antenna_in_world, bool loose) {
  if (has_antenna_) {
    const double step = (antenna_in_world - last_antenna_).norm();
    way_m_ += step;
    if (loose) loose_m_ += step;
  }
  last_antenna_ = antenna_in_world;
  has_antenna_ = true;
}

// The local map follows the pulled scans, as its older part is left behind.
void FixDrift::note_pull(const Vector3d& alone, const Vector3d& pulled) {
  const double renewed = std::min(1.0, (way_m_ - probed_way_m_) / kMapWayM);
  map_drawn_ += renewed * scan_drawn_;
  scan_drawn_ = pulled - alone;
  probed_way_m_ = way_m_;
}

FixDrift::Departure FixDrift::departure(const Anchor& now, const Anchor& before) const {
  const Vector3d moved = now.antenna - before.antenna;
  const Vector3d off = (now.fix - before.fix) - moved;
  const double share = left_ ? kReturnShare : kOdometryShare;
  const double odometry = std::hypot(kOdometryM, share * (now.way_m - before.way_m) +
                                                     kLooseShare * (now.loose_m - before.loose_m));
  const Vector3d variance =
      now.variance + before.variance + Vector3d::Constant(odometry * odometry);
  // The map was laid on the globe with an error of its heading, which moves things aside.
  const Eigen::Vector2d aside_of = heading_sd_rad_ * Eigen::Vector2d(-moved.y(), moved.x());
  const Eigen::Matrix2d in_plane =
      variance.head<2>().mean() * Eigen::Matrix2d::Identity() + aside_of * aside_of.transpose();
  const Eigen::Vector2d off_plane = off.head<2>();
  const double plane_steps = std::sqrt(off_plane.dot(in_plane.inverse() * off_plane));
  const double height_steps = std::abs(off.z()) / std::sqrt(variance.z());
  if (plane_steps >= height_steps) return {off_plane.norm(), plane_steps};
  return {std::abs(off.z()), height_steps};
}

// The median over some of the anchors: one that was trusted and wrong must not decide. The last few
// show a quick drift soon, all of them a slow one.
FixDrift::Departure FixDrift::largest_departure(const Anchor& now) const {
  Departure largest;
  for (const std::size_t count : {std::min(kFewAnchors, anchors_.size()), anchors_.size()}) {
    const Departure usual = usual_departure(now, count);
    if (usual.steps > largest.steps) largest = usual;
  }
  return largest;
}

FixDrift::Departure FixDrift::usual_departure(const Anchor& now, std::size_t count) const {
  std::vector<Departure> all;
  for (std::size_t i = anchors_.size() - count; i < anchors_.size(); ++i)
    all.push_back(departure(now, anchors_[i]));
  if (all.empty()) return {};
  const auto middle = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2);
  std::nth_element(all.begin(), middle, all.end(),
                   [](const Departure& a, const Departure& b) { return a.steps < b.steps; });
  return *middle;
}

double FixDrift::add_fix(const FixAtAntenna& fix) {
  const Anchor now{fix.fix_in_world, fix.antenna_in_world - map_drawn_ - scan_drawn_,
                   fix.covariance.diagonal(), way_m_, loose_m_};
  const Departure off = largest_departure(now);
  left_ = off.steps > kLeavingSteps;
  if (left_) {
    farthest_m_ = std::max(farthest_m_, off.metres);
    return off.metres;
  }
  if (anchors_.empty() || now.way_m - anchors_.back().way_m >= kAnchorStepM) {
    anchors_.push_back(now);
    if (anchors_.size() > kMostAnchors) anchors_.pop_front();
  }
  return 0.0;
}

void FixDrift::move(const Pose& fixes, const Pose& path) {
  for (Anchor& anchor : anchors_) {
    anchor.fix = fixes * anchor.fix;
    anchor.antenna = path * anchor.antenna;
  }
  last_antenna_ = path * last_antenna_;
  map_drawn_ = path.rotation() * map_drawn_;
  scan_drawn_ = path.rotation() * scan_drawn_;
}

void FixDrift::clear() {
  const double farthest_m = farthest_m_;
  *this = FixDrift(heading_sd_rad_);
  farthest_m_ = farthest_m;
}

void FixDrift::save(BinaryWriter& writer) const {
  writer.put(static_cast<std::uint64_t>(anchors_.size()));
  for (const Anchor& anchor : anchors_) {
    for (const Vector3d* vector : {&anchor.fix, &anchor.antenna, &anchor.variance})
      writer.put_doubles(vector->data(), 3);
    writer.put(anchor.way_m);
    writer.put(anchor.loose_m);
  }
  for (const Vector3d* vector : {&last_antenna_, &map_drawn_, &scan_drawn_})
    writer.put_doubles(vector->data(), 3);
  writer.put(has_antenna_);
  for (const double value : {way_m_, loose_m_, probed_way_m_, farthest_m_})
    writer.put(value);
  writer.put(left_);
}

void FixDrift::load(BinaryReader& reader) {
  clear();
  for (auto left = reader.get<std::uint64_t>(); left > 0; --left) {
    Anchor anchor;
    for (Vector3d* vector : {&anchor.fix, &anchor.antenna, &anchor.variance})
      reader.get_doubles(vector->data(), 3);
    anchor.way_m = reader.get<double>();
    anchor.loose_m = reader.get<double>();
    anchors_.push_back(anchor);
  }
  for (Vector3d* vector : {&last_antenna_, &map_drawn_, &scan_drawn_})
    reader.get_doubles(vector->data(), 3);
  has_antenna_ = reader.get<bool>();
  for (double* value : {&way_m_, &loose_m_, &probed_way_m_, &farthest_m_})
    *value = reader.get<double>();
  left_ = reader.get<bool>();
}

}  // namespace understory
