#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/map/keyframes/keyframe_map.h"
#include "understory/pipeline/run_folder/journal.h"

namespace understory {

// One scan of the finished run, world frame.
struct FinishedScan {
  const ScanRecord* record = nullptr;
  Pose world_from_body;
  Eigen::Vector3d velocity_in_world = Eigen::Vector3d::Zero();
};

// Hands out the scans of the journal in order, with the poses that the finished keyframes give
// them. Between two keyframes a scan keeps its odometry from the first one. What the second graph
// moved the second keyframe against that odometry is spread over the scans between. It goes by
// powers of the correction, in proportion to time (P0 (19)). Nothing is spread over the way to a
// keyframe that begins a piece of map. Its scan keeps its place, and those before belong to the
// piece before.
void for_each_finished_scan(const Journal& journal, const std::vector<Keyframe>& keyframes,
                            const std::function<void(const FinishedScan&)>& visit);

}  // namespace understory
