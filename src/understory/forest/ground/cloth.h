#pragma once

#include <vector>

#include "understory/util/progress.h"

namespace understory {

// A cloth under a terrain, in a cloud turned upside down. It rises until it meets the lowest
// points, and its stiffness carries it under what stands on the ground.
struct ClothConfig {
  int stiffness = 2;
  int steps = 500;
};

// `floor` are the lowest heights per node (NaN where none), row by row. Returns the height of the
// cloth at every node. W. Zhang et al. 2016, eqs. (4)-(7), with all nodes of a step moved at once,
// so that the result does not depend on the order of nodes or threads. Polls `progress`.
[[nodiscard]] std::vector<float> settle_cloth(const std::vector<float>& floor, int columns,
                                              int rows, const ClothConfig& config,
                                              const ProgressSink& progress = {});

}  // namespace understory
