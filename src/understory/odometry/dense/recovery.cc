#include "understory/odometry/dense/recovery.h"

#include <cmath>

#include "understory/geometry/pose_io.h"
#include "understory/odometry/odometry_constants.h"

namespace understory {
namespace {

using namespace odometry_constants::recovery;

// m, of the worst direction.
double place_sigma(const NavState& predicted) {
  return std::sqrt(predicted.pose_covariance.diagonal().tail<3>().maxCoeff());
}

}  // namespace

bool Recovery::is_outage(TimeNs stamp) const {
  return to_seconds(stamp - last_seen_) > kOutageS;
}

bool Recovery::lost_over_outage(TimeNs stamp, const DenseEstimate& estimate) const {
  if (to_seconds(stamp - last_seen_) < kOutageS || last_inliers_ <= 0.0) return false;
  return !estimate.matched || estimate.match.inlier_ratio < kFoundAgainShare * last_inliers_;
}

bool Recovery::lost(const DenseEstimate& estimate, std::uint64_t unmatched_in_a_row) const {
  const bool finite = estimate.state.world_from_body.matrix().allFinite() &&
                      estimate.state.velocity_in_world.allFinite() &&
                      estimate.state.velocity_in_world.norm() < kHighestSpeedMPerS;
  const bool matched = estimate.matched && estimate.update.status == MotionStatus::kAccepted;
  return !finite ||
         (!matched && unmatched_in_a_row + 1 >= static_cast<std::uint64_t>(lost_after_scans_));
}

bool Recovery::waits(const NavState& predicted, const DenseEstimate& estimate) {
  const bool was_blind = last_scan_ > last_seen_;
  if (!was_blind || estimate.matched || place_sigma(predicted) > kCertainSigmaM) return false;
  return waited_++ < kWaitedScans;
}

void Recovery::note_scan(TimeNs stamp, bool seen) {
  last_scan_ = stamp;
  if (!seen) return;
  last_seen_ = stamp;
  waited_ = 0;
}

Pose Recovery::place_after_outage(const NavState& predicted) const {
  return place_sigma(predicted) < kWorthlessSigmaM ? predicted.world_from_body : last_good_;
}

void Recovery::note_good(const DenseEstimate& estimate) {
  last_good_ = estimate.state.world_from_body;
  last_velocity_ = last_good_.rotation().conjugate() * estimate.state.velocity_in_world;
  if (estimate.matched) last_inliers_ = estimate.match.inlier_ratio;
}

void Recovery::save(BinaryWriter& writer) const {
  put_pose(writer, last_good_);
  writer.put(last_inliers_);
  writer.put_doubles(last_velocity_.data(), 3);
  writer.put(last_scan_);
  writer.put(last_seen_);
  writer.put(waited_);
}

void Recovery::load(BinaryReader& reader) {
  last_good_ = get_pose(reader);
  last_inliers_ = reader.get<double>();
  reader.get_doubles(last_velocity_.data(), 3);
  last_scan_ = reader.get<TimeNs>();
  last_seen_ = reader.get<TimeNs>();
  waited_ = reader.get<std::uint32_t>();
}

void put_at(const Pose& world_from_body, DenseOdometry& odometry, DenseEstimate& estimate) {
  const Eigen::Vector3d forward = world_from_body.rotation() * Eigen::Vector3d::UnitX();
  const Pose placed(so3_exp({0.0, 0.0, std::atan2(forward.y(), forward.x())}),
                    world_from_body.translation());
  odometry.move_world(placed);
  estimate.state.world_from_body = placed * estimate.state.world_from_body;
  estimate.state.velocity_in_world = placed.rotation() * estimate.state.velocity_in_world;
}

}  // namespace understory
