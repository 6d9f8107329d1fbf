#include "understory/evaluation/trees/tree_match_chance.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "understory/evaluation/trees/tree_errors.h"
#include "understory/util/random.h"

namespace understory {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// A stand of 900 trees per hectare.
std::vector<Tree> dense_stand(std::uint64_t seed, int n = 90) {
  Random random(seed);
  const double side = std::sqrt(n / 0.09);
  std::vector<Tree> trees;
  while (static_cast<int>(trees.size()) < n) {
    Tree tree;
    tree.id = static_cast<int>(trees.size()) + 1;
    tree.x = random.uniform(0.0, side);
    tree.y = random.uniform(0.0, side);
    tree.dbh_m = random.normal(0.22, 0.05);
    tree.observations = 10;
    bool free = true;
    for (const Tree& other : trees)
      free = free && std::hypot(other.x - tree.x, other.y - tree.y) > 1.2;
    if (free) trees.push_back(tree);
  }
  return trees;
}

// Of the same stand, later: bent, noisy, one tree in five missed.
std::vector<Tree> seen_again(const std::vector<Tree>& trees, std::uint64_t seed) {
  Random random(seed);
  std::vector<Tree> result;
  for (Tree tree : trees) {
    if (random.chance(0.2)) continue;
    tree.x += 0.3 * std::sin(0.06 * tree.y) + random.normal(0.0, 0.05);
    tree.y += 0.3 * std::cos(0.05 * tree.x) + random.normal(0.0, 0.05);
    tree.dbh_m += random.normal(0.0, 0.015);
    result.push_back(tree);
  }
  return result;
}

std::vector<Tree> without_diameters(std::vector<Tree> trees) {
  for (Tree& tree : trees)
    tree.dbh_m = kNan;
  return trees;
}

MatchChance judge(const std::vector<Tree>& s, std::vector<Tree> l, bool searched) {
  const TreeMergeConfig config;
  if (searched) {
    const auto motion = align_trees(l, s, Alignment::kYaw, config.reach_m);
    EXPECT_TRUE(motion.has_value());
    l = moved(l, motion.value_or(Pose()));
  }
  return match_chance(s, l, merge_trees(s, l, 0.5, config), 0.5, config, searched);
}

const Pose kElsewhere(Eigen::Quaterniond(Eigen::AngleAxisd(2.1, Eigen::Vector3d::UnitZ())),
                      Eigen::Vector3d(40.0, -12.0, 0.0));

TEST(MatchChance, TheSameStandIsBeyondChance) {
  for (const std::uint64_t seed : {1, 2}) {
    const std::vector<Tree> trees = dense_stand(seed);
    const std::vector<Tree> again = seen_again(trees, 100 + seed);
    for (const bool searched : {false, true}) {
      const MatchChance chance =
          judge(without_diameters(trees), searched ? moved(again, kElsewhere) : again, searched);
      EXPECT_TRUE(chance.beyond_chance) << chance_complaint(chance);
      EXPECT_GT(chance.sigmas, 4.0);
      EXPECT_EQ(chance_complaint(chance), "");
    }
    EXPECT_GT(judge(trees, again, false).diameter_correlation, 0.8);
  }
}

TEST(MatchChance, TwoStandsAreNot) {
  for (const std::uint64_t seed : {1, 2}) {
    const std::vector<Tree> trees = dense_stand(seed);
    const std::vector<Tree> others = seen_again(dense_stand(10 + seed), 100 + seed);
    for (const bool searched : {false, true}) {
      const MatchChance chance = judge(trees, others, searched);
      EXPECT_GE(chance.pairs, 5U);  // which is what deceives
      EXPECT_FALSE(chance.beyond_chance) << chance.sigmas << ' ' << chance.diameter_sigmas;
      EXPECT_NE(chance_complaint(chance).find("different stands"), std::string::npos);
    }
  }
}

// Rows of planted trees lie on rows of planted trees: only the diameters tell.
TEST(MatchChance, PlantedRowsAreToldByTheirDiameters) {
  Random random(4);
  std::vector<Tree> rows;
  for (int i = 0; i < 100; ++i) {
    Tree tree;
    tree.id = i + 1;
    tree.x = 3.0 * (i % 10) + random.normal(0.0, 0.05);
    tree.y = 3.0 * (i / 10) + random.normal(0.0, 0.05);
    tree.dbh_m = random.normal(0.2, 0.03);
    tree.observations = 5;
    rows.push_back(tree);
  }
  std::vector<Tree> others = seen_again(rows, 5);
  EXPECT_TRUE(judge(rows, others, false).beyond_chance);
  for (Tree& tree : others)
    tree.dbh_m = random.normal(0.2, 0.03);
  EXPECT_LT(std::abs(judge(rows, others, true).diameter_sigmas), 4.0);
}

TEST(MatchChance, FewPairsTellNothing) {
  const std::vector<Tree> trees = dense_stand(1, 4);
  EXPECT_FALSE(judge(trees, trees, false).beyond_chance);
  EXPECT_FALSE(
      judge(trees,
            moved(trees, Pose(Eigen::Quaterniond::Identity(), Eigen::Vector3d(1000.0, 0.0, 0.0))),
            false)
          .beyond_chance);
}

}  // namespace
}  // namespace understory
