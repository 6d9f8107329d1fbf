#pragma once

#include <span>

#include "understory/geometry/stamped_pose.h"

namespace understory {

// The pose of a path at a time, on the screw between its neighbours, P4 (34). Before the first pose
// it is that one. After the last pose the last step goes on by at most this share of it (`beyond`;
// 0: the last pose).
//   path: in order of time, no two poses of one time, not empty
[[nodiscard]] Pose pose_on_path(std::span<const StampedPose> path, TimeNs time,
                                double beyond = 0.0);

}  // namespace understory
