#include "understory/odometry/stem_front_end.h"

#include <cmath>
#include <numbers>

namespace understory {
namespace {

// A pause of the recording: what moved before it says nothing about now.
constexpr double kLongestStep = 2.0;

}  // namespace

void describe(ConfigTable& table, StemFrontEndConfig& config) {
  table.add("min_score", config.min_score, {0.0, 1.0}, "",
            "probability from which on a segment counts as a stem");
  table.add("max_range_m", config.max_range_m, {5.0, 200.0}, "m", "reach of the stem detection");
  table.add("keep_distance_m", config.keep_distance_m, {0.0, 20.0}, "m",
            "a view is kept for the map when the body has moved that far ...");
  table.add("keep_turn_deg", config.keep_turn_deg, {0.0, 180.0}, "deg", "... or turned that much");
  table.section("odometry", [&] { describe(table, config.odometry); });
}

StemView StemFrontEnd::view_of(const Scan& scan, const Rig& rig, const StemSegments& found,
                               const Vector6d& motion_per_s) const {
  StemView view;
  view.frame = count_;
  view.stamp = scan.stamp;
  view.stems.reserve(found.stems.size());
  for (const StemSegment& segment : found.stems) {
    const Pose stamp_from_lidar =
        Pose::exp(1e-9 * segment.t_ns * motion_per_s) * rig.body_from_lidar;
    view.stems.push_back(stem_of(segment, stamp_from_lidar, found.up));
  }
  return view;
}

bool StemFrontEnd::to_be_kept(const Pose& world_from_body) {
  if (last_kept_) {
    const Pose moved = last_kept_->inverse() * world_from_body;
    const double turn_deg = moved.angle() * 180.0 / std::numbers::pi;
    if (moved.translation().norm() < config_.keep_distance_m && turn_deg < config_.keep_turn_deg)
      return false;
  }
  last_kept_ = world_from_body;
  return true;
}

StemScan StemFrontEnd::add(const Scan& scan, const Rig& rig) {
  StemSegmentConfig segments;
  segments.min_score = config_.min_score;
  segments.max_range_m = config_.max_range_m;
  segments.up =
      up_in_lidar_
          ? *up_in_lidar_
          : Eigen::Vector3d(rig.body_from_lidar.rotation().inverse() * Eigen::Vector3d::UnitZ());
  const StemSegments found = find_stem_segments(scan, segments);
  if (!found.stems.empty()) up_in_lidar_ = found.up;

  StemScan result;
  const double since = last_ ? to_seconds(scan.stamp - last_->stamp) : 0.0;
  const bool follows = last_ && since > 0.0 && since < kLongestStep;
  Vector6d motion = follows ? motion_per_s_ : Vector6d::Zero();
  if (follows && scan.has_point_times) {
    // The step of a first try says how the body moved up to this scan; the scan itself lies half a
    // step later than the middle of that. Where scans follow each other without a pause, what is
    // taken out wrongly would come back larger by such an outlook, so there is none.
    const bool pauses = to_seconds(scan.end() - scan.stamp) < 0.4 * since;
    SparseOdometry trial = odometry_;
    const SparseStep step = trial.track(view_of(scan, rig, found, motion));
    const Vector6d latest = (last_->world_from_body.inverse() * step.world_from_body).log() / since;
    if (step.status == SparseStepStatus::kTracked || step.status == SparseStepStatus::kSearched)
      motion = pauses ? Vector6d(1.5 * latest - 0.5 * motion_per_s_) : latest;
  }
  result.view = view_of(scan, rig, found, motion);
  result.motion_rad_s = motion.head<3>().norm();
  result.step = odometry_.track(result.view);
  motion_per_s_.setZero();
  if (follows)
    motion_per_s_ = (last_->world_from_body.inverse() * result.step.world_from_body).log() / since;
  last_ = StampedPose{scan.stamp, result.step.world_from_body};
  result.keep = !result.view.stems.empty() && to_be_kept(result.step.world_from_body);
  if (result.keep) odometry_.take_up_last();
  ++count_;
  return result;
}

}  // namespace understory
