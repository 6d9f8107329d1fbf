#pragma once

#include <vector>

#include "understory/graph/pose_graph.h"
#include "understory/graph/stem_loops.h"
#include "understory/odometry/sparse_odometry.h"
#include "understory/sensor/stem_view.h"

namespace understory {

// Trajectory after closing loops over chained odometry.
struct StemCorrection {
  std::vector<StemLoop> loops;  // a row per view for which a place was found
  std::vector<char> accepted;   // verified, and in agreement with the rest
  std::vector<Pose> world_from_body;
  bool converged = true;
  std::string reason;  // if not
};

// Finds loops by tree pattern and solves the pose graph of odometry and loops, wrong loops
// rejected. Same result for any number of threads.
[[nodiscard]] StemCorrection close_stem_loops(const std::vector<StemView>& views,
                                              const std::vector<SparseStep>& steps,
                                              const StemLoopConfig& loops,
                                              const PoseGraphConfig& graph);

}  // namespace understory
