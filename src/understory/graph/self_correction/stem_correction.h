#pragma once

#include <vector>

#include "understory/graph/loops/stem_loops.h"
#include "understory/graph/pose_graph.h"
#include "understory/graph/self_correction/self_correction.h"
#include "understory/graph/self_correction/stem_sights.h"
#include "understory/odometry/stems/sparse_odometry.h"
#include "understory/sensor/stem_view.h"
#include "understory/util/progress.h"
#include "understory/util/timing.h"

namespace understory {

// Loops, pose graph and self-correction of a map of stems, in this order.
struct StemCorrectionConfig {
  bool close_loops = true;
  StemLoopConfig loops;
  PoseGraphConfig graph;
  SelfCorrectionConfig correction;
  StemSightConfig map;
};
void describe(ConfigTable& table, StemCorrectionConfig& config);

// Trajectory after closing loops over chained odometry and correcting the map by itself.
struct StemCorrection {
  std::vector<StemLoop> loops;  // a row per view for which a place was found
  std::vector<char> accepted;   // verified, and in agreement with the rest
  // By how much each disagrees with the chained odometry, 0 where it was not verified.
  std::vector<double> loop_shift_m;
  std::vector<Pose> world_from_body;
  bool converged = true;
  std::string reason;  // if not
  SelfCorrectionResult self;
};

// Finds loops by tree pattern and solves the pose graph of odometry and loops, wrong loops
// rejected; then the map corrects itself (graph/self_correction/self_correction.h). Wall time goes
// to the stages "loops" and "self_correction". Same result for any number of threads. Polls
// `progress`.
[[nodiscard]] StemCorrection correct_stems(const std::vector<StemView>& views,
                                           const std::vector<SparseStep>& steps,
                                           const StemCorrectionConfig& config, StageTimes& times,
                                           const ProgressSink& progress = {});

// Sharpness of the map of these views placed by these poses (of the body), of all their stems.
[[nodiscard]] MapSharpness stem_sharpness(const std::vector<StemView>& views,
                                          const std::vector<Pose>& world_from_body,
                                          const SharpnessConfig& config);

}  // namespace understory
