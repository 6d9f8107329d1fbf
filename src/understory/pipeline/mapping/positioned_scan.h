#pragma once

#include <optional>

#include "understory/geometry/stamped_pose.h"

namespace understory {

// A scan that has got its pose from the odometry.
struct PositionedScan {
  TimeNs end = 0;    // of the scan
  StampedPose pose;  // world frame, at the scan's stamp
  // The world frame of this pose from that of the poses before, where it was moved since.
  std::optional<Pose> new_world_from_old_world;
  bool begins_piece = false;  // how it lies to the poses before is not known
  // At the middle of the scan, by its match alone, in the world of `pose`. None where no match was
  // accepted, and none by stems.
  std::optional<StampedPose> matched_middle;
};

}  // namespace understory
