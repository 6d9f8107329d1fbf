#pragma once

#include <vector>

#include "understory/graph/stem_matching/tree_pattern.h"
#include "understory/registration/stems/sparse_icp.h"
#include "understory/util/config/config.h"
#include "understory/util/progress.h"

namespace understory {

// How loops are found among views of stems. L0 is the mean distance between neighbouring stems.
struct StemLoopConfig {
  TreePatternConfig pattern;
  SparseIcpConfig icp;
  int exclude_recent = 50;      // views; nearer ones are the same passage
  double place_spacing = 2.0;   // L0; of the places that are kept to be found, along the path
  double max_distance_m = 3.0;  // views farther apart than this are not of the same place
  double gather_l0 = 5.0;       // views within that part of the way to each side are laid together,
  int gather_views = 10;        // at most that many to each side; 0 L0: each view by itself
  double min_overlap = 0.4;     // P0's lambda0, section 2.3
  double min_gathered_overlap = 0.5;  // of views laid together, where single ones have too little
};
void describe(ConfigTable& table, StemLoopConfig& config);

// The best place that was found for one view. Poses are of level frames (z up).
struct StemLoop {
  int query = 0;
  int match = 0;         // an earlier view
  double overlap = 0.0;  // of the two views after matching, 0..1; else of those laid together
  // Overlap as laid together, less the farther the views are apart: overlap * exp(-(distance /
  // max_distance_m)^2). Views of one place overlap wherever they look from, but also with the next
  // place.
  double score = 0.0;
  Pose match_from_query;
  Matrix6d covariance = Matrix6d::Identity();  // right perturbation
  bool verified = false;                       // overlap and distance are those of a loop
};

// What loops are looked for in: views of stems along a path.
struct StemPath {
  const std::vector<SparsePoints>& views;  // level frames
  // How neighbouring views lie to each other, and which earlier view lies nearest to a place that
  // was found. No guess is taken from it.
  const std::vector<Pose>& world_from_view;
  const std::vector<Matrix6d>& step_covariances;  // of the motion from the view before, right
};

// For every view the place seen before that it looks like most. Tree pattern and ICP find it among
// views laid together with their neighbours (`gather_l0`), without stems farther away than views
// reach. ICP of the two views themselves verifies and measures it, or else ICP of what was laid
// together. Views without any candidate have no row. Same result for any number of threads. Polls
// `progress`.
[[nodiscard]] std::vector<StemLoop> find_stem_loops(const StemPath& path,
                                                    const StemLoopConfig& config,
                                                    const ProgressSink& progress = {});

}  // namespace understory
