#pragma once

#include <optional>
#include <vector>

#include "understory/features/stem_segments.h"
#include "understory/geometry/stamped_pose.h"
#include "understory/odometry/sparse_odometry.h"
#include "understory/sensor/rig.h"
#include "understory/sensor/scan.h"
#include "understory/sensor/stem_view.h"
#include "understory/util/config.h"

namespace understory {

struct StemFrontEndConfig {
  double min_score = 0.5;     // of a stem to be used
  double max_range_m = 42.0;  // of a stem's returns
  // A view is kept for the map when the body has moved or turned that much since the last one.
  double keep_distance_m = 0.5;
  double keep_turn_deg = 12.0;
  SparseOdometryConfig odometry;
};
void describe(ConfigTable& table, StemFrontEndConfig& config);

// What became of one scan.
struct StemScan {
  StemView view;    // body frame as it stood at the scan's stamp
  SparseStep step;  // world_from_body at the scan's stamp
  bool keep = false;
  double motion_rad_s = 0.0;  // rate of turn that was taken out of the scan
};

// Raw scans to positions from their stems alone: stems of each scan (features/stem_segments.h),
// each moved to the scan's stamp by the motion at its own time, then matched to those before. The
// motion within a scan is first guessed from the steps before it and, once the scan has been
// matched, taken from its own step. No IMU. Not thread-safe; deterministic.
class StemFrontEnd {
 public:
  explicit StemFrontEnd(const StemFrontEndConfig& config)
      : config_(config), odometry_(config.odometry) {}

  [[nodiscard]] StemScan add(const Scan& scan, const Rig& rig);

 private:
  [[nodiscard]] StemView view_of(const Scan& scan, const Rig& rig, const StemSegments& found,
                                 const Vector6d& motion_per_s) const;
  [[nodiscard]] bool to_be_kept(const Pose& world_from_body);

  StemFrontEndConfig config_;
  SparseOdometry odometry_;
  int count_ = 0;
  std::optional<Eigen::Vector3d> up_in_lidar_;
  std::optional<StampedPose> last_;
  std::optional<Pose> last_kept_;
  Vector6d motion_per_s_ = Vector6d::Zero();  // of the body, right perturbation
};

}  // namespace understory
