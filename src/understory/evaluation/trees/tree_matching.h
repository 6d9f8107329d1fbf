#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "understory/sensor/tree.h"

namespace understory {

// An index into A and one into B.
using TreePair = std::pair<std::size_t, std::size_t>;

// One-to-one pairs within the radius in the plane, the nearest pair first (greedy by distance, ties
// by index). In ascending order of the index into A. Time grows as the trees and the pairs within
// the radius.
[[nodiscard]] std::vector<TreePair> match_trees(const std::vector<Tree>& a,
                                                const std::vector<Tree>& b, double radius_m);

// How two lists are matched at best.
struct TreeAssignmentConfig {
  double radius_m = 0.5;  // farther trees are not the same, in the plane
  // Diameters that differ by this share of the larger one count as much as a whole radius; larger
  // differences count no more. A diameter chooses among near trees and excludes none.
  double diameter_share = 0.3;
  std::size_t most_pairs = 20'000'000;  // within the radius, 16 bytes each
};

// One-to-one pairs within the radius that cost least together, in position and diameter. A pair
// costs (d / radius)^2 + min(1, difference / (share * larger diameter))^2, its second term 1/2
// where a diameter is unknown. A tree of A without a partner costs 2, as the worst pair. So no two
// free trees are left within the radius. Exact over all trees (least_cost_assignment). In ascending
// order of the index into A. Throws InputError where more than `most_pairs` lie within the radius.
[[nodiscard]] std::vector<TreePair> assign_trees(const std::vector<Tree>& a,
                                                 const std::vector<Tree>& b,
                                                 const TreeAssignmentConfig& config);
// What such a pair costs, 0 to 2.
[[nodiscard]] double pair_cost(const Tree& a, const Tree& b, const TreeAssignmentConfig& config);

}  // namespace understory
