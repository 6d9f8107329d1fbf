#pragma once

#include <vector>

#include "understory/forest/dead_wood/dead_wood.h"

namespace understory {

// A stump in the frame of the search: heights above the ground.
struct StumpFit {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  // at the ground
  Eigen::Vector2d top = Eigen::Vector2d::Zero();     // of the centre line at its height
  double height_m = 0.0;
  double diameter_m = 0.0;  // at the ground
  double diameter_to_m = 0.0;
  double diameter_sd_m = 0.0;
  int returns = 0;
};

// Short stems that end in a cut: circles one above the other from near the ground, with hardly a
// point above them. The foot of a tree goes on, a boulder narrows upwards. `points`: thinned, by
// height above the ground; they come back sorted by place. Feet of `stems` are none. Gives those
// with the centre in `where`, by x, then y. Deterministic.
[[nodiscard]] std::vector<StumpFit> find_stumps(std::vector<SlicePoint>& points,
                                                const std::vector<StemFit>& stems,
                                                const StemSearchArea& where,
                                                const ProgressSink& progress);
// m around the area: points so far away may matter.
[[nodiscard]] double stump_search_reach();

}  // namespace understory
