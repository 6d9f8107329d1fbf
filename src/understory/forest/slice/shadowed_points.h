#pragma once

#include <vector>

#include "understory/forest/stems/stem_detector.h"

namespace understory {

// Points of both lists over a shadow: hardly a point lies below them, in the squares of half a
// metre around. What hides the foot of a stem leaves such a shadow. Only those from `lowest_m`
// above the ground up to below `highest_m` are given. `slices` and `above` are relative to one
// origin.
[[nodiscard]] std::vector<SlicePoint> points_over_shadows(const std::vector<SlicePoint>& slices,
                                                          const std::vector<SlicePoint>& above,
                                                          double lowest_m, double highest_m);
// m around a point: others so far away may matter.
[[nodiscard]] double shadow_reach_m();

}  // namespace understory
