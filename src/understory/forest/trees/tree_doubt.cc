#include "understory/forest/trees/tree_doubt.h"

#include <algorithm>
#include <cmath>

#include "understory/forest/forest_constants.h"

namespace understory {

using namespace forest_constants::tree_doubt;

bool has_weak_diameter(const Tree& tree) {
  return tree.dbh_sd_m > kWeakShare * tree.dbh_m;
}

StandDoubts doubts_of(const std::vector<Tree>& trees) {
  StandDoubts doubts;
  doubts.trees = trees.size();
  for (const Tree& tree : trees) {
    const bool measured = std::isfinite(tree.dbh_m);
    doubts.diameters += measured ? 1 : 0;
    doubts.by_crown += measured ? 0 : 1;
    doubts.weak_diameters += has_weak_diameter(tree) ? 1 : 0;
    doubts.without_height += std::isfinite(tree.height_m) ? 0 : 1;
  }
  return doubts;
}

std::string quality_of(const Tree& tree, double arc_deg, double seen_from_m) {
  if (!std::isfinite(tree.dbh_m)) return "no_diameter";
  if (has_weak_diameter(tree)) return "weak_diameter";
  if (seen_from_m > kHiddenTo) return "breast_height_hidden";
  return arc_deg < kHalfTurn ? "one_side" : "good";
}

double doubt_of(const Tree& tree, double arc_deg) {
  double doubt = std::isfinite(tree.height_m) ? 0.0 : kNoHeight;
  if (!std::isfinite(tree.dbh_m)) return doubt + kNoDiameter;
  if (std::isfinite(arc_deg)) doubt += std::max(0.0, 1.0 - arc_deg / kHalfTurn);
  if (std::isfinite(tree.dbh_sd_m) && tree.dbh_m > 0.0)
    doubt += std::min(tree.dbh_sd_m / (kWeakShare * tree.dbh_m), kMostShares);
  return doubt;
}

}  // namespace understory
