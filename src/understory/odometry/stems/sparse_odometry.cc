#include "understory/odometry/stems/sparse_odometry.h"

#include <algorithm>
#include <cmath>

#include "understory/geometry/matrix_inverse.h"
#include "understory/geometry/pose_io.h"
#include "understory/geometry/rotation_between.h"
#include "understory/geometry/symmetric_solver.h"
#include "understory/odometry/odometry_constants.h"

namespace understory {
namespace {

// Takes out what is left of tilt in a pose's rotation, keeping the heading of its x axis. Of its y
// axis less a right angle, where x is upright.
Pose upright(const Pose& pose) {
  Eigen::Vector3d x = pose.rotation() * Eigen::Vector3d::UnitX();
  if (x.head<2>().norm() < odometry_constants::initial_state::kUprightAxis)
    x = (pose.rotation() * Eigen::Vector3d::UnitY()).cross(Eigen::Vector3d::UnitZ());
  return Pose(
      Eigen::Quaterniond(Eigen::AngleAxisd(std::atan2(x.y(), x.x()), Eigen::Vector3d::UnitZ())),
      pose.translation());
}

// Turns a view that was matched towards the tilt that its stems show, by a share. In the plane its
// feet stay on those that they were matched to, as well as they can: the body stands some metres
// above them. Turned about its own place by a hundredth of a degree, always the same way, it would
// lose half a millimetre at each view. Its height stays: the tilt comes from the axes of the stems,
// not from heights.
Pose hold_tilt(const Pose& world_from_level, const Matrix6d& information, double share) {
  const Eigen::Vector3d seen = world_from_level.rotation() * Eigen::Vector3d::UnitZ();
  const Eigen::Quaterniond whole = rotation_between(seen, Eigen::Vector3d::UnitZ());
  const Eigen::Vector3d turn =
      world_from_level.rotation().inverse() * (share * so3_log(whole)).eval();
  Vector6d step = Vector6d::Zero();
  step.head<2>() = turn.head<2>();
  // What heading and place do where the tilt is held: the conditional mean.
  Eigen::Matrix3d rest = information.block<3, 3>(2, 2);
  rest.diagonal().array() += 1e-6 + 1e-9 * rest.diagonal().maxCoeff();
  step.segment<3>(2) =
      -SymmetricSolver<3>(rest).solve(information.block<3, 2>(2, 0) * turn.head<2>());
  return world_from_level * Pose::exp(step);
}

Matrix6d step_covariance(const SparseIcpResult& icp) {
  // What no pair constrains has this much freedom: a radian, ten metres.
  Matrix6d information = icp.information;
  information.topLeftCorner<3, 3>() += Eigen::Matrix3d::Identity();
  information.bottomRightCorner<3, 3>() += 0.01 * Eigen::Matrix3d::Identity();
  return inverse_matrix(information);
}

}  // namespace

GoIcpConfig SparseOdometryConfig::small_box() {
  GoIcpConfig config;
  config.yaw_range_deg = 15.0;
  config.shift_range_m = 1.5;
  return config;
}

void describe(ConfigTable& table, SparseOdometryConfig& config) {
  table.add_enum(
      "target", config.target,
      {{"frame", SparseOdometryConfig::Target::kFrame},
       {"map", SparseOdometryConfig::Target::kMap}},
      "what a view is matched to: frame (the view before) or map (a local map of stems)");
  table.add_enum("matcher", config.matcher,
                 {{"icp", SparseOdometryConfig::Matcher::kIcp},
                  {"go_icp", SparseOdometryConfig::Matcher::kGoIcp}},
                 "icp: trimmed ICP from the prediction; go_icp: first branch and bound in a small "
                 "box around the prediction");
  table.add("min_overlap", config.min_overlap, {0.0, 1.0}, "",
            "share of a view's stems that must be found again; with fewer a search follows");
  table.add("map_forgetting", config.map_forgetting, {0.01, 1.0}, "",
            "largest share by which a stem of the local map moves to its newest sight; less where "
            "sights scatter");
  table.add("map_frames", config.map_frames, {1, 10'000}, "",
            "stems that so many views did not see leave the local map");
  table.add("tilt_gain", config.tilt_gain, {0.0, 1.0}, "",
            "share of the tilt from the stems' axes taken over at each view");
  table.section("icp", [&] { describe(table, config.icp); });
  table.section("go_icp", [&] { describe(table, config.go_icp); });
  table.section("search", [&] { describe(table, config.search); });
}

const char* to_string(SparseStepStatus status) {
  switch (status) {
    case SparseStepStatus::kFirst:
      return "first";
    case SparseStepStatus::kTracked:
      return "tracked";
    case SparseStepStatus::kSearched:
      return "searched";
    case SparseStepStatus::kWeak:
      return "weak";
    case SparseStepStatus::kUnmatched:
      break;
  }
  return "unmatched";
}

std::shared_ptr<const SparseTarget> SparseOdometry::target() const {
  SparsePoints points;
  std::vector<double> sds;
  points.reserve(landmarks_.size());
  for (const Landmark& landmark : landmarks_) {
    points.push_back(landmark.point_in_world - origin_);
    if (landmark.height_sd_m > 0.0) sds.push_back(landmark.height_sd_m);
  }
  if (sds.size() < points.size()) sds.clear();
  return std::make_shared<const SparseTarget>(points, std::move(sds));
}

// Of the view's level frame, in the world's axes with the local map's origin.
Pose SparseOdometry::guess(const Pose& level_from_body,
                           const std::optional<Pose>& expected_step) const {
  const Eigen::Quaterniond last = upright(world_from_level_).rotation();
  const Eigen::Vector3d at = world_from_body_.translation() - origin_;
  if (!expected_step) return Pose(last, at + last * last_shift_in_level_);
  const Pose expected = world_from_body_ * *expected_step * level_from_body.inverse();
  return Pose(upright(expected).rotation(), expected.translation() - origin_);
}

SparseOdometry::Match SparseOdometry::match(const Source& source, const Pose& guess) const {
  const SparseTarget& target = *target_;
  const Pose last(upright(world_from_level_).rotation(), world_from_body_.translation() - origin_);
  Match match;
  match.l0_m = target.l0_m;
  Pose start = guess;
  if (config_.matcher == SparseOdometryConfig::Matcher::kGoIcp) {
    const GoIcpResult found = register_go_icp(target, source.points, guess, config_.go_icp);
    if (found.status != GoIcpStatus::kTooFewPoints) start = found.target_from_source;
  }
  match.icp = register_sparse_icp(target, source.points, start, config_.icp, source.height_sd_m);
  if (match.icp.overlap >= config_.min_overlap) return match;
  match.searched = true;
  for (const YawVoteCandidate& candidate : vote_yaw(target, source.points, last, config_.search)) {
    const SparseIcpResult icp = register_sparse_icp(
        target, source.points, candidate.target_from_source, config_.icp, source.height_sd_m);
    if (icp.overlap > match.icp.overlap) match.icp = icp;
  }
  return match;
}

// The first sights of a stem count alike, until each new one has the share of the steady state.
// Heights have a share of their own, and the newest one counts unless they are very noisy.
// A foot that was guessed from afar is seen at last, and averages of both bend paths in height.
void SparseOdometry::see_again(Landmark& landmark, const Eigen::Vector3d& at) {
  const Eigen::Vector3d change = at - landmark.last_sight_in_world;
  const Eigen::Vector3d& before = landmark.last_change;
  if (landmark.sights > 1) {
    plane_noise_.add(change.head<2>().squaredNorm(), before.head<2>().squaredNorm(),
                     change.head<2>().dot(before.head<2>()));
    height_noise_.add(change.z() * change.z(), before.z() * before.z(), change.z() * before.z());
  }
  landmark.last_change = change;
  landmark.last_sight_in_world = at;
  ++landmark.sights;
  const auto share = [&](const SightNoise& noise) {
    return std::min(config_.map_forgetting, std::max(noise.gain(), 1.0 / landmark.sights));
  };
  const double in_plane = share(plane_noise_);
  const Eigen::Vector3d shares(in_plane, in_plane, share(height_noise_));
  landmark.point_in_world += shares.cwiseProduct(at - landmark.point_in_world);
}

void SparseOdometry::take_up(const Source& source, const Pose& world_from_level) {
  if (config_.target == SparseOdometryConfig::Target::kFrame) landmarks_.clear();
  SparsePoints known;
  known.reserve(landmarks_.size());
  for (const Landmark& landmark : landmarks_)
    known.push_back(landmark.point_in_world);
  const SparseTarget grid(known);
  const double near = config_.icp.overlap_distance_ratio * grid.l0_m * 2.0;
  std::vector<char> taken(landmarks_.size(), 0);
  for (std::size_t i = 0; i < source.points.size(); ++i) {
    const Eigen::Vector3d at = world_from_level * source.points[i];
    const double height_sd = source.height_sd_m.empty() ? 0.0 : source.height_sd_m[i];
    const auto found = known.empty() ? PlaneGrid::Neighbour{} : grid.grid.nearest(at, near, 0.0);
    const auto k = static_cast<std::size_t>(found.index);
    if (found.index >= 0 && taken[k] == 0) {
      taken[k] = 1;
      see_again(landmarks_[k], at);
      landmarks_[k].height_sd_m = height_sd;
      landmarks_[k].last_seen = count_;
    } else if (found.index < 0) {
      landmarks_.push_back({at, height_sd, count_, 1, at, Eigen::Vector3d::Zero()});
    }
  }
  plane_noise_.end_view();
  height_noise_.end_view();
  std::erase_if(landmarks_, [&](const Landmark& landmark) {
    return count_ - landmark.last_seen > config_.map_frames;
  });
}

SparseStep SparseOdometry::add(const StemView& view) {
  const SparseStep step = track(view);
  take_up_last();
  return step;
}

void SparseOdometry::take_up_last() {
  take_up(last_source_, world_from_level_);
  ++count_;
  origin_ = world_from_body_.translation();
  target_ = target();
}

Eigen::Vector3d SparseOdometry::about_up(const StemView& view) const {
  if (count_ == 0) return up_of_axes(view);
  return world_from_body_.rotation().conjugate() * Eigen::Vector3d::UnitZ();
}

SparseStep SparseOdometry::track(const StemView& view, const std::optional<Pose>& expected_step,
                                 const std::optional<StemUp>& known_up) {
  const StemUp up = known_up ? *known_up : stem_up(view, about_up(view));
  const Pose level_from_body(understory::level_from_body(up), Eigen::Vector3d::Zero());
  Source source{stem_points(view, level_from_body.rotation()), height_sds(view, up.up_in_body)};
  SparseStep step;
  step.up = up;
  if (count_ == 0) {
    // The first body frame's x axis, laid level, is the world's; y, where x is upright.
    world_from_body_ = upright(level_from_body).inverse() * level_from_body;
  } else {
    const Match found = match(source, guess(level_from_body, expected_step));
    step.status = found.icp.status == SparseIcpStatus::kTooFewPoints ? SparseStepStatus::kUnmatched
                  : found.icp.overlap < config_.min_overlap          ? SparseStepStatus::kWeak
                  : found.searched                                   ? SparseStepStatus::kSearched
                                                                     : SparseStepStatus::kTracked;
    step.overlap = found.icp.overlap;
    step.error_m = found.icp.error_m;
    step.spacing_m = found.l0_m;
    step.covariance =
        compose_covariance(step_covariance(found.icp), level_from_body, Matrix6d::Zero());
    const Pose origin(Eigen::Quaterniond::Identity(), origin_);
    const Pose matched = origin * found.icp.target_from_source;
    step.previous_from_body = world_from_body_.inverse() * matched * level_from_body;
    world_from_body_ =
        (up.stems > 0 ? hold_tilt(matched, found.icp.information, config_.tilt_gain) : matched) *
        level_from_body;
    last_shift_in_level_ = upright(world_from_level_).inverse() * world_from_body_.translation();
  }
  step.world_from_body = world_from_body_;
  world_from_level_ = world_from_body_ * level_from_body.inverse();
  last_source_ = std::move(source);
  return step;
}

void SparseOdometry::save(BinaryWriter& writer) const {
  writer.put(static_cast<std::uint64_t>(landmarks_.size()));
  for (const Landmark& landmark : landmarks_) {
    writer.put_doubles(landmark.point_in_world.data(), 3);
    writer.put(landmark.height_sd_m);
    writer.put(landmark.last_seen);
    writer.put(landmark.sights);
    writer.put_doubles(landmark.last_sight_in_world.data(), 3);
    writer.put_doubles(landmark.last_change.data(), 3);
  }
  plane_noise_.save(writer);
  height_noise_.save(writer);
  writer.put(static_cast<std::uint64_t>(last_source_.points.size()));
  for (const Eigen::Vector3d& point : last_source_.points)
    writer.put_doubles(point.data(), 3);
  writer.put(last_source_.height_sd_m);
  writer.put_doubles(origin_.data(), 3);
  writer.put(count_);
  put_pose(writer, world_from_body_);
  put_pose(writer, world_from_level_);
  writer.put_doubles(last_shift_in_level_.data(), 3);
}

void SparseOdometry::load(BinaryReader& reader) {
  landmarks_.clear();
  for (auto left = reader.get<std::uint64_t>(); left > 0; --left) {
    Landmark& landmark = landmarks_.emplace_back();
    reader.get_doubles(landmark.point_in_world.data(), 3);
    landmark.height_sd_m = reader.get<double>();
    landmark.last_seen = reader.get<int>();
    landmark.sights = reader.get<int>();
    reader.get_doubles(landmark.last_sight_in_world.data(), 3);
    reader.get_doubles(landmark.last_change.data(), 3);
  }
  plane_noise_.load(reader);
  height_noise_.load(reader);
  last_source_.points.clear();
  for (auto left = reader.get<std::uint64_t>(); left > 0; --left)
    reader.get_doubles(last_source_.points.emplace_back().data(), 3);
  last_source_.height_sd_m = reader.get_vector<double>();
  reader.get_doubles(origin_.data(), 3);
  count_ = reader.get<int>();
  world_from_body_ = get_pose(reader);
  world_from_level_ = get_pose(reader);
  reader.get_doubles(last_shift_in_level_.data(), 3);
  target_ = count_ > 0 ? target() : nullptr;
}

}  // namespace understory
