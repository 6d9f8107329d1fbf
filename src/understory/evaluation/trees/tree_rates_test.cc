#include "understory/evaluation/trees/tree_rates.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace understory {
namespace {

std::vector<Tree> long_stand() {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> along(-10.0, 210.0);
  std::uniform_real_distribution<double> across(-40.0, 60.0);
  std::vector<Tree> trees;
  while (trees.size() < 900) {
    Tree tree;
    tree.x = along(random);
    tree.y = across(random);
    bool free = true;
    for (const Tree& other : trees)
      free &= std::hypot(other.x - tree.x, other.y - tree.y) > 1.5;
    if (free) trees.push_back(tree);
  }
  return trees;
}

Trajectory road(double y) {
  Trajectory path;
  for (int k = 0; k <= 400; ++k) {
    StampedPose pose;
    pose.stamp = k;
    pose.world_from_body = Pose(Eigen::Quaterniond::Identity(), {0.5 * k, y, 0.0});
    path.push_back(pose);
  }
  return path;
}

TEST(TreeRates, DetectionFallsWithTheDistance) {
  const std::vector<Tree> truth = long_stand();
  std::vector<Tree> found;
  for (std::size_t k = 0; k < truth.size(); ++k) {
    const double away = std::abs(truth[k].y);
    if (away < 10.0 || (away < 20.0 && k % 2 == 0)) found.push_back(truth[k]);
  }
  Tree wrong = truth.front();
  wrong.x = 50.0;
  wrong.y = 3.0;
  for (const Tree& tree : truth)
    ASSERT_GT(std::hypot(tree.x - wrong.x, tree.y - wrong.y), 0.3);
  found.push_back(wrong);
  const auto rates =
      rates_over_distance(found, truth, match_trees(found, truth, 0.3), road(0.0), 5.0, 25.0);
  ASSERT_EQ(rates.size(), 5U);
  EXPECT_GT(rates[0].expected, 60U);
  EXPECT_DOUBLE_EQ(rates[0].recall, 1.0);
  EXPECT_EQ(rates[0].right + 1, rates[0].reported);
  // Beyond the ends of the road the distance is to its end, so a few lie in the next ring.
  EXPECT_GT(rates[1].recall, 0.97);
  EXPECT_NEAR(rates[2].recall, 0.5, 0.15);
  EXPECT_NEAR(rates[3].recall, 0.5, 0.15);
  EXPECT_LT(rates[4].recall, 0.1);
  EXPECT_DOUBLE_EQ(rates[2].precision, 1.0);
}

TEST(TreeRates, FelledTreesAreNeitherMissedNorFalse) {
  std::vector<Tree> truth = long_stand();
  const std::vector<Tree> found = truth;
  for (std::size_t k = 0; k < truth.size(); k += 3)
    truth[k].felled = true;
  const auto rates =
      rates_over_distance(found, truth, match_trees(found, truth, 0.3), road(0.0), 10.0, 20.0);
  EXPECT_DOUBLE_EQ(rates[0].recall, 1.0);
  EXPECT_EQ(rates[0].reported, rates[0].expected);
  EXPECT_DOUBLE_EQ(rates[0].precision, 1.0);
}

TEST(TreeRates, TheLastRingEndsAtTheReach) {
  // 17 * 0.1 is a little more than 1.7, and 1.7 / 0.1 is 17.
  std::vector<Tree> trees(1);
  trees[0].x = 0.0;
  trees[0].y = 1.7;
  const Trajectory path = {{0, Pose()},
                           {1, Pose(Eigen::Quaterniond::Identity(), Eigen::Vector3d::UnitX())}};
  const auto rates =
      rates_over_distance(trees, trees, match_trees(trees, trees, 0.3), path, 0.1, 17 * 0.1);
  ASSERT_EQ(rates.size(), 17U);
  EXPECT_EQ(rates.back().found, 1U);
}

TEST(TreeRates, ABentMapIsConsistentInParts) {
  const std::vector<Tree> a = long_stand();
  std::vector<Tree> b = a;
  // A heading that drifts by a degree over 200 m.
  for (Tree& tree : b)
    tree.y += 0.5 * 0.0175 * tree.x * tree.x / 200.0;
  const MapConsistency same = map_consistency(a, a, road(0.0), road(22.5), {});
  EXPECT_DOUBLE_EQ(same.as_placed, 1.0);
  EXPECT_DOUBLE_EQ(same.in_parts, 1.0);
  EXPECT_EQ(same.parts, 4U);
  const MapConsistency bent = map_consistency(a, b, road(0.0), road(22.5), {});
  EXPECT_LT(bent.as_placed, 0.7);
  EXPECT_GT(bent.moved, bent.as_placed);
  EXPECT_LT(bent.moved, 0.9);
  EXPECT_GT(bent.in_parts, 0.95);
}

TEST(TreeRates, OnlyWhatBothCanSeeCounts) {
  const std::vector<Tree> all = long_stand();
  std::vector<Tree> near_a;
  std::vector<Tree> near_b;
  for (const Tree& tree : all) {
    if (std::abs(tree.y) < 22.0) near_a.push_back(tree);
    if (std::abs(tree.y - 22.5) < 22.0) near_b.push_back(tree);
  }
  const MapConsistency seen = map_consistency(near_a, near_b, road(0.0), road(22.5), {});
  EXPECT_DOUBLE_EQ(seen.as_placed, 1.0);
  EXPECT_EQ(seen.trees_a, seen.trees_b);
  EXPECT_LT(seen.trees_a, near_a.size());
  EXPECT_DOUBLE_EQ(consistency(80, 100, 80), 80.0 / 90.0);
  EXPECT_EQ(map_consistency({}, near_b, road(0.0), road(22.5), {}).parts, 0U);
}

}  // namespace
}  // namespace understory
