#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/odometry/imu/imu_buffer.h"
#include "understory/preprocess/machine_boxes.h"
#include "understory/sensor/rig.h"
#include "understory/sensor/scan.h"

namespace understory {

// How the body moves while scans are gathered.
struct GatheredMotion {
  Vector6d per_s = Vector6d::Zero();  // right perturbation: rad/s, m/s
  // Turns are taken from it where it covers the scans; may be null.
  const ImuBuffer* samples = nullptr;
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();  // rad/s, axes of the body
};

// Several scans of a lidar whose lines sweep over its field of view (Livox), as one scan with level
// rings: what stem_segments.h cuts. All points lie where they were at `stamp`, in the frame of the
// lidar. They fall into cells of elevation and azimuth. A cell with two points or more gives one
// return, the mean of those about its median range. Rings count from the lowest cell up.
//
// `scans` are in order of time, at least one. Points within `boxes` (may be null) are left out. The
// result has no point times, since the motion is taken out. Deterministic; thread-safe.
[[nodiscard]] ScanPtr gather_scans(std::span<const ScanPtr> scans, TimeNs stamp, const Rig& rig,
                                   const GatheredMotion& motion,
                                   const std::vector<MachineBox>* boxes = nullptr);

}  // namespace understory
