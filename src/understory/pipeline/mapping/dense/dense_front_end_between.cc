// Poses between scans, as they were known then. Predictions come at the rate of the IMU (P4 F2),
// estimates from parts of a revolution (P4, discussion).
#include "understory/pipeline/mapping/dense/dense_front_end.h"

namespace understory {

// As soon as the last point of a part is there, the scan before is positioned, and its map is the
// local map. So it is here, where all parts come with the last one.
void DenseFrontEnd::match_parts(const Scan& scan) {
  if (journal_->size() == 0) return;
  const std::vector<PartEstimate> parts =
      odometry_->match_parts(scan, map_->local_map(), config_.scan_fraction);
  if (parts.empty()) return;
  const Pose body_from_world =
      odometry_->motion().predict(odometry_->last_scan()).world_from_body.inverse();
  DenseCounts& counts = received_.counts;
  for (const PartEstimate& part : parts) {
    between_.parts()->add(
        {part.stamp, journal_->size() - 1, body_from_world * part.world_from_body});
    ++counts.scan_parts;
    counts.scan_parts_matched += part.matched ? 1 : 0;
    counts.parts_span += part.end - part.stamp;
  }
  ++counts.cut_scans;
  counts.cut_scans_span += scan.end() - scan.stamp;
}

// What a machine would have had at this sample: the state at the last scan that is positioned, and
// what the IMU says since.
void DenseFrontEnd::predict_at(TimeNs stamp) {
  if (journal_->size() == 0) return;
  const MotionModel& motion = odometry_->motion();
  const TimeNs scan = odometry_->last_scan();
  if (stamp <= scan) return;
  const std::vector<StampedPose> path = motion.predict_path(scan, stamp);
  between_.imu()->add({stamp, journal_->size() - 1,
                       path.front().world_from_body.inverse() * path.back().world_from_body});
  ++received_.counts.predictions;
  const ImuTrust trust = motion.imu_trust();
  const bool by_imu = odometry_->uses_imu() && trust.usable && !trust.on_probation;
  if (!by_imu) ++received_.counts.coasted;
}

}  // namespace understory
