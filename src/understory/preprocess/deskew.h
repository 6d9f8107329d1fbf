#pragma once

#include <cstdint>
#include <span>

#include "understory/geometry/stamped_pose.h"
#include "understory/preprocess/body_cloud.h"
#include "understory/sensor/rig.h"
#include "understory/sensor/scan.h"

namespace understory {

// How finely the poses within a scan are taken.
struct DeskewConfig {
  // Points whose times fall into the same step share one pose. 20 us at 1 rad/s moves a point 100 m
  // away by at most 1 mm.
  std::int64_t time_step_ns = 20'000;
  // Outside the given poses the nearest motion is continued this long, then the pose stands still.
  double max_extrapolation_s = 0.02;
};

// A scan whose points lie where they were at one time, in the body frame, metres.
struct DeskewResult {
  BodyCloud cloud;
  std::size_t extrapolated = 0;  // points measured before the first or after the last pose
  bool deskewed = false;         // false: no point times or fewer than two poses; points only moved
                                 // into the body frame
};

// Takes the motion during the scan out of it, column by column, P4 (34, 35):
//   point_in_body(t0) = world_from_body(t0)^-1 world_from_body(ti) body_from_lidar point_in_lidar
// with poses interpolated in SE(3) between `poses`, which are sorted by stamp. `keep`, if not
// empty, has one entry a point; points with 0 are left out. Parallel; same bits for any number of
// threads. Thread-safe.
[[nodiscard]] DeskewResult deskew(const Scan& scan, const Rig& rig,
                                  std::span<const StampedPose> poses,
                                  std::span<const std::uint8_t> keep = {},
                                  const DeskewConfig& config = {});

}  // namespace understory
