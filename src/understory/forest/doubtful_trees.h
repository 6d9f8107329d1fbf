#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace understory {

struct InventoryResult;
struct StemSheets;

// A place to stand at, so that trees are measured again (trees/look_again.h).
struct LookAgain {
  Eigen::Vector3d place = Eigen::Vector3d::Zero();    // on the ground, world frame
  Eigen::Vector2d towards = Eigen::Vector2d::Zero();  // the middle of its trees from there, metres
  std::vector<int> trees;                             // their ids, nearest first
  int unseen_sides = 0;  // of these trees, those of which a side is missing; others lack points
};

// "unseen side", "few points", or both, for a table.
[[nodiscard]] std::string reason_of(const LookAgain& look);

// Fills in `sheets` and `look_again` of an inventory whose trees are known otherwise. A tree of
// which a point is follows from `owners`, where there are any.
void look_at_doubtful_trees(StemSheets sheets, InventoryResult& result);

}  // namespace understory
