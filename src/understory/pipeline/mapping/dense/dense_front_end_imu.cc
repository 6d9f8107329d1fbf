// What the scans say of place and clock of the IMU.
#include "understory/pipeline/mapping/dense/dense_front_end.h"

namespace understory {

// What a run before this one found stands in the place of what is given.
void DenseFrontEnd::refine_rig() {
  if (!conditions_.imu_refined || without_samples()) return;
  rig_.body_from_imu = conditions_.imu_refined->body_from_imu;
  rig_.imu_extrinsic_source = "refined by the recording";
}

// A scan's middle is what its match knows best, whatever its points were deskewed by.
void DenseFrontEnd::note_middle(const DenseEstimate& estimate, const ScanRecord& record) {
  if (!estimate.matched || record.outcome != ScanOutcome::kMatched) return;
  const Pose middle = estimate.match.target_from_source * estimate.stamp_from_middle;
  const auto& levelled = estimate.update.new_world_from_old_world;
  positioned_.matched_middle = {record.stamp + (estimate.scan_end - record.stamp) / 2,
                                levelled ? *levelled * middle : middle};
}

// Nothing of the run depends on the check; on the calibration it does where it is asked for.
void DenseFrontEnd::check_clock(const DenseEstimate& estimate, const ScanRecord& record) {
  if (!odometry_->uses_imu() || !rig_.body_from_imu) return;
  if (!estimate.matched || record.outcome != ScanOutcome::kMatched) {
    received_.clock.break_off();
    return;
  }
  const Pose& matched = estimate.match.target_from_source;
  received_.clock.add_scan(record.stamp, estimate.scan_end, matched.rotation(),
                           rig_.body_from_imu->rotation());
  if (received_.calibration) {
    const TimeNs middle = record.stamp + (estimate.scan_end - record.stamp) / 2;
    received_.calibration->add_scan({middle, matched * estimate.stamp_from_middle},
                                    *rig_.body_from_imu);
  }
  if (const auto& levelled = estimate.update.new_world_from_old_world) {
    received_.clock.turn_world(levelled->rotation());
    if (received_.calibration) received_.calibration->move_world(*levelled);
  }
}

std::optional<ClockCheckResult> DenseFrontEnd::clock_check() const {
  if (!started() || !odometry_->uses_imu()) return std::nullopt;
  return received_.clock.result();
}

std::optional<RefinedImu> DenseFrontEnd::refined_imu() const {
  if (!received_.calibration || !started() || !odometry_->uses_imu()) return std::nullopt;
  const std::optional<OnlineImuEstimate> found = received_.calibration->so_far();
  if (!found || !found->differs) return std::nullopt;
  return RefinedImu{
      found->body_from_imu,
      found->late_s + (conditions_.imu_refined ? conditions_.imu_refined->late_s : 0.0)};
}

std::optional<OnlineImuEstimate> DenseFrontEnd::imu_calibration() const {
  if (!received_.calibration || !started() || !odometry_->uses_imu()) return std::nullopt;
  std::optional<OnlineImuEstimate> found = received_.calibration->finished();
  if (found && conditions_.imu_refined) found->late_s += conditions_.imu_refined->late_s;
  return found;
}

}  // namespace understory
