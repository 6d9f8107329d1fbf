// Poses between scans, as they were known then (P4 F2: prediction at the rate of the IMU).
#include "understory/pipeline/mapping/dense/dense_front_end.h"

namespace understory {

void DenseFrontEnd::begin_paths_between() {
  imu_path_.reset();
  if (config_.imu_rate) imu_path_ = std::make_unique<RelativePath>(folder_ / kImuPathFile);
}

// What a machine would have had at this sample: the state at the last scan that is positioned, and
// what the IMU says since.
void DenseFrontEnd::predict_at(TimeNs stamp) {
  if (journal_->size() == 0) return;
  const MotionModel& motion = odometry_->motion();
  const TimeNs scan = odometry_->last_scan();
  if (stamp <= scan) return;
  const std::vector<StampedPose> path = motion.predict_path(scan, stamp);
  imu_path_->add({stamp, journal_->size() - 1,
                  path.front().world_from_body.inverse() * path.back().world_from_body});
  ++received_.counts.predictions;
  const ImuTrust trust = motion.imu_trust();
  const bool by_imu = odometry_->uses_imu() && trust.usable && !trust.on_probation;
  if (!by_imu) ++received_.counts.coasted;
}

}  // namespace understory
