#pragma once

#include <vector>

#include "understory/forest/search/circle_search.h"
#include "understory/forest/stems/stem_detector.h"

namespace understory {

// A circle with the height of its slice.
struct Ring {
  Circle circle;
  double height_m = 0.0;
  int slice = 0;
  [[nodiscard]] double quality() const { return circle.on * circle.even_deg; }
};

// Links rings of different slices along straight lines, best rings first; each ring serves one
// stem. The fits are starts: centre, slope, median radius and the rings used.
[[nodiscard]] std::vector<StemFit> link_rings(const std::vector<Ring>& rings, int min_slices,
                                              double max_lean_deg);

}  // namespace understory
