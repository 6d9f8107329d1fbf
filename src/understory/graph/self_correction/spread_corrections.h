#pragma once

#include <span>
#include <vector>

#include "understory/geometry/stamped_pose.h"

namespace understory {

// Poses of all scans from the corrected poses of some of them. Between two corrected scans the
// correction (a motion of the world, corrected_from_path = corrected * path^-1) runs from the one
// to the other along its screw. It goes by the share of the way along the path, P0 (19) in the form
// that acts in the first frame. Before the first and after the last it is carried on rigidly, P0
// (20).
//
// `corrected` holds scans of `path`, by increasing stamp. Returns a pose for each of `path`.
[[nodiscard]] std::vector<StampedPose> spread_corrections(std::span<const StampedPose> path,
                                                          std::span<const StampedPose> corrected);

}  // namespace understory
