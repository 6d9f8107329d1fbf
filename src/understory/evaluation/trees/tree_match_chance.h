#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "understory/evaluation/trees/tree_matching.h"
#include "understory/evaluation/trees/tree_merge.h"
#include "understory/sensor/tree.h"
#include "understory/util/progress.h"

namespace understory {

// Whether two tree maps that were merged show the same trees, or trees that lie near each other by
// chance. In a stand of 1,000 trees per hectare most places have a tree within 1.5 m.
struct MatchChance {
  std::size_t pairs = 0;  // trees that were found in both
  // Weight of the pairs: sum of 1 - d^2 / r^2, d their distance before they were joined, r the
  // largest one.
  double weight = 0.0;
  // The same for copies of the second map that keep its density and its extent, but no place of a
  // tree. Mean and standard deviation are over the copies.
  int copies = 0;
  double chance_weight = 0.0;
  double chance_sd = 0.0;
  double sigmas = 0.0;  // (weight - chance_weight) / max(chance_sd, sqrt(chance_weight), 1)
  // Agreement of the diameters of the pairs that have both: correlation, and how many of its
  // standard deviations it is from none (Fisher). NaN: fewer than eight pairs, or no spread.
  std::size_t diameters = 0;
  double diameter_correlation = 0.0;
  double diameter_sigmas = 0.0;
  bool beyond_chance = false;
};

// `s` and `l` as they are merged. `searched`: `l` was first laid on `s` by the trees alone
// (align_trees by heading), so each copy is, too. Deterministic. Polls `progress`.
// Thresholds: docs/method/sparse.md.
[[nodiscard]] MatchChance match_chance(const std::vector<Tree>& s, const std::vector<Tree>& l,
                                       const MergedTrees& merged, double weight,
                                       const TreeMergeConfig& config, bool searched,
                                       const ProgressSink& progress = {});

// The same for two lists whose trees stay where they are: `pairs` of A and B within `radius_m`, as
// match_trees or assign_trees finds them. The copies are matched by match_trees. `searched`: A was
// first laid on B by the trees alone. Deterministic. Polls `progress`.
[[nodiscard]] MatchChance match_chance(const std::vector<Tree>& a, const std::vector<Tree>& b,
                                       const std::vector<TreePair>& pairs, double radius_m,
                                       bool searched, const ProgressSink& progress = {});

// Why the maps may be of different stands, in words for the user; empty if they are of one.
[[nodiscard]] std::string chance_complaint(const MatchChance& chance);

}  // namespace understory
