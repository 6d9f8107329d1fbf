#pragma once

#include <Eigen/Core>
#include <vector>

#include "understory/geometry/points.h"

namespace understory {

// A thing that stands alone and upright: a stem, a post. Levelled frame of its cloud, metres.
struct Upright {
  Eigen::Vector2d at = Eigen::Vector2d::Zero();  // middle of what was seen of it
  double ground_m = 0.0;                         // height of the ground there
  int levels = 0;                                // half metres of height in which it stands alone
};

// What stands alone in a levelled cloud between 0.7 and 7.2 m above the ground, by slices of half a
// metre: narrow itself, and little beside it. `above_m` is each point's height above the ground.
// Those of many slices first, then the nearest, `most` of them. Thread-safe, deterministic.
[[nodiscard]] std::vector<Upright> find_uprights(const Points& points,
                                                 const std::vector<float>& above_m,
                                                 std::size_t most);

}  // namespace understory
