#include "understory/evaluation/trees/tree_list_check.h"

#include <gtest/gtest.h>

#include <cmath>

namespace understory {
namespace {

// A grid of trees 2 m apart, 8 to 39 cm thick.
std::vector<Tree> tree_grid(double unit = 1.0) {
  std::vector<Tree> trees;
  for (int k = 0; k < 40; ++k) {
    Tree tree;
    tree.id = k + 1;
    tree.x = 2.0 * (k % 8) + 0.01 * k;
    tree.y = 2.0 * static_cast<double>(k / 8);
    tree.dbh_m = (0.08 + 0.008 * k) * unit;
    tree.observations = 10 + k;
    trees.push_back(tree);
  }
  return trees;
}

std::vector<TreePair> each_with_itself() {
  std::vector<TreePair> pairs;
  for (std::size_t k = 0; k < 40; ++k)
    pairs.emplace_back(k, k);
  return pairs;
}

TEST(TreeListCheck, DiametersInAnotherUnitAreNamed) {
  EXPECT_EQ(diameter_complaint(tree_grid()), "");
  EXPECT_NE(diameter_complaint(tree_grid(100.0)).find("centimetres"), std::string::npos);
  EXPECT_NE(diameter_complaint(tree_grid(1.0 / 0.0254)).find("inches"), std::string::npos);
  EXPECT_NE(diameter_complaint(tree_grid(1000.0)).find("millimetres"), std::string::npos);
  EXPECT_NE(diameter_complaint(tree_grid(0.001)).find("no metres"), std::string::npos);
  EXPECT_EQ(diameter_complaint(tree_grid(1.0 / 0.3048)), "");  // feet: a stand of veterans
  EXPECT_EQ(diameter_complaint(tree_grid(-1.0)), "");  // no diameters: their reader refuses them
  EXPECT_EQ(diameter_complaint(std::vector<Tree>(40)), "");
  EXPECT_EQ(diameter_complaint(std::vector<Tree>()), "");
}

TEST(TreeListCheck, PairsTellFeetAndRadii) {
  const std::vector<TreePair> pairs = each_with_itself();
  EXPECT_EQ(diameter_complaint(tree_grid(), tree_grid(), pairs), "");
  EXPECT_EQ(diameter_complaint(tree_grid(), tree_grid(1.4), pairs), "");  // as maps of two methods
  EXPECT_NE(diameter_complaint(tree_grid(), tree_grid(1.0 / 0.3048), pairs).find("3.28 times"),
            std::string::npos);
  EXPECT_NE(diameter_complaint(tree_grid(), tree_grid(0.5), pairs).find("radii"),
            std::string::npos);
  EXPECT_EQ(diameter_complaint(tree_grid(), tree_grid(100.0), {}), "");
}

TEST(TreeListCheck, TreesThatStandTwiceAreCounted) {
  std::vector<Tree> trees = tree_grid();
  EXPECT_EQ(doubled_rows(trees), 0U);
  for (int k = 0; k < 10; ++k) {
    trees.push_back(trees[static_cast<std::size_t>(k)]);
    trees.back().x += k % 2 == 0 ? 0.03 : -0.03;
    trees.back().y += 0.02;
  }
  EXPECT_EQ(doubled_rows(trees), 10U);
  EXPECT_NE(doubles_complaint(trees).find("10 of 50 rows"), std::string::npos);
  trees.resize(42);  // two forks among many trees
  EXPECT_EQ(doubles_complaint(trees), "");
  EXPECT_EQ(doubles_complaint({}), "");
}

TEST(TreeListCheck, ACopyIsKnownInAnyOrderAndWithMoreRows) {
  std::vector<Tree> other = tree_grid();
  EXPECT_TRUE(are_copies(tree_grid(), other));
  std::swap(other.front(), other.back());
  other.insert(other.end(), other.begin(), other.begin() + 10);
  EXPECT_TRUE(are_copies(tree_grid(), other));
  EXPECT_TRUE(are_copies(other, tree_grid()));
  for (Tree& tree : other)
    tree.x += 0.001;
  EXPECT_FALSE(are_copies(tree_grid(), other));
  EXPECT_FALSE(are_copies({}, {}));
}

// Bug: permanent plots that were measured anew counted as copies, since trees stay in their places.
TEST(TreeListCheck, APlotThatIsMeasuredAnewIsNoCopy) {
  std::vector<Tree> later = tree_grid();
  for (std::size_t k = 0; k < later.size(); ++k)
    if (k % 3 == 0) later[k].dbh_m += 0.01;
  EXPECT_FALSE(are_copies(tree_grid(), later));
  std::vector<Tree> corrected = tree_grid();
  corrected[7].dbh_m += 0.01;
  EXPECT_TRUE(are_copies(tree_grid(), corrected));
  std::vector<Tree> bare = tree_grid();  // the same list without diameters
  for (Tree& tree : bare)
    tree.dbh_m = Tree::kUnknown;
  EXPECT_TRUE(are_copies(tree_grid(), bare));
  std::vector<Tree> old = tree_grid();
  std::vector<Tree> higher = tree_grid();
  for (std::size_t k = 0; k < old.size(); ++k) {
    old[k].height_m = 12.0;
    higher[k].height_m = 13.0;
  }
  EXPECT_FALSE(are_copies(old, higher));
}

}  // namespace
}  // namespace understory
