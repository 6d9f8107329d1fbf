#include "understory/evaluation/trees/tree_matching.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "understory/evaluation/trees/tree_errors.h"
#include "understory/util/error.h"
#include "understory/util/random.h"

namespace understory {
namespace {

Tree stem(double x, double y, double dbh_m = NAN) {
  Tree tree;
  tree.x = x;
  tree.y = y;
  tree.dbh_m = dbh_m;
  return tree;
}

std::vector<Tree> stems(std::uint64_t seed, int n, double extent_m, double origin_m) {
  Random random(seed);
  std::vector<Tree> trees;
  for (int i = 0; i < n; ++i)
    trees.push_back(stem(origin_m + random.uniform(-extent_m, extent_m),
                         random.uniform(-extent_m, extent_m), random.uniform(0.05, 0.6)));
  return trees;
}

// Greedy over all pairs, as it is defined.
std::vector<TreePair> nearest_first(const std::vector<Tree>& a, const std::vector<Tree>& b,
                                    double radius_m) {
  std::vector<std::tuple<double, std::size_t, std::size_t>> all;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t j = 0; j < b.size(); ++j) {
      const double d = std::hypot(a[i].x - b[j].x, a[i].y - b[j].y);
      if (d <= radius_m) all.emplace_back(d, i, j);
    }
  }
  std::sort(all.begin(), all.end());
  std::vector<bool> taken_a(a.size());
  std::vector<bool> taken_b(b.size());
  std::vector<TreePair> pairs;
  for (const auto& [d, i, j] : all) {
    if (taken_a[i] || taken_b[j]) continue;
    taken_a[i] = taken_b[j] = true;
    pairs.emplace_back(i, j);
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

double cost_of_pairs(const std::vector<Tree>& a, const std::vector<Tree>& b,
                     const std::vector<TreePair>& pairs, const TreeAssignmentConfig& config) {
  double cost = 2.0 * static_cast<double>(a.size() - pairs.size());
  for (const auto& [i, j] : pairs)
    cost += pair_cost(a[i], b[j], config);
  return cost;
}

TEST(TreeMatching, CellsFindThePairsThatAllDistancesFind) {
  for (const double origin_m : {0.0, 6'700'000.0}) {
    for (const double radius_m : {0.1, 0.5, 3.0, 100.0}) {
      std::vector<Tree> a = stems(5, 150, 10.0, origin_m);
      std::vector<Tree> b = stems(6, 150, 10.0, origin_m);
      a.push_back(stem(1e9, -1e9));  // one far away must not matter
      // Exactly at the radius, across a border of cells.
      a.push_back(stem(origin_m + 20.0, 0.0));
      b.push_back(stem(origin_m + 20.0 + radius_m, 0.0));
      EXPECT_EQ(match_trees(a, b, radius_m), nearest_first(a, b, radius_m));
    }
  }
  EXPECT_TRUE(match_trees({}, {}, 0.5).empty());
}

TEST(TreeMatching, TheBestPairsAreNotTheNearestOnes) {
  // Nearest first takes (1, 0) and leaves two trees; together both find partners.
  const std::vector<Tree> a = {stem(0.0, 0.0), stem(0.45, 0.0)};
  const std::vector<Tree> b = {stem(0.30, 0.0), stem(0.80, 0.0)};
  EXPECT_EQ(match_trees(a, b, 0.5).size(), 1U);
  EXPECT_EQ(assign_trees(a, b, {}), (std::vector<TreePair>{{0, 0}, {1, 1}}));
}

TEST(TreeMatching, DiametersChooseAmongNearTreesAndExcludeNone) {
  const std::vector<Tree> a = {stem(0.0, 0.0, 0.10), stem(0.3, 0.0, 0.40)};
  const std::vector<Tree> b = {stem(0.12, 0.0, 0.40), stem(0.18, 0.0, 0.10)};
  EXPECT_EQ(match_trees(a, b, 0.5), (std::vector<TreePair>{{0, 0}, {1, 1}}));
  EXPECT_EQ(assign_trees(a, b, {}), (std::vector<TreePair>{{0, 1}, {1, 0}}));
  // Alone within the radius it is the partner, however wrong its diameter is.
  EXPECT_EQ(assign_trees({stem(0, 0, 0.1)}, {stem(0.49, 0, 0.9)}, {}).size(), 1U);
  EXPECT_TRUE(assign_trees({stem(0, 0, 0.1)}, {stem(0.51, 0, 0.1)}, {}).empty());
}

TEST(TreeMatching, CostOfAPair) {
  const TreeAssignmentConfig config;
  EXPECT_NEAR(pair_cost(stem(0, 0, 0.2), stem(0.3, 0.4, 0.2), config), 1.0, 1e-12);
  // 6 cm of 40 cm are half of 30 %.
  EXPECT_NEAR(pair_cost(stem(0, 0, 0.40), stem(0, 0, 0.34), config), 0.25, 1e-12);
  EXPECT_NEAR(pair_cost(stem(0, 0, 0.40), stem(0.25, 0, 0.10), config), 1.25, 1e-12);
  EXPECT_NEAR(pair_cost(stem(0, 0), stem(0, 0, 0.3), config), 0.5, 1e-12);
}

TEST(TreeMatching, CostsNoMoreThanNearestFirstAndLeavesNoNearTrees) {
  double less = 0.0;
  for (std::uint64_t seed = 1; seed < 8; ++seed) {
    const std::vector<Tree> a = stems(seed, 300, 10.0, 0.0);
    const std::vector<Tree> b = stems(seed + 100, 330, 10.0, 0.0);
    const TreeAssignmentConfig config{1.5, 0.3,
                                      100'000};  // joins the trees into one large component
    const auto pairs = assign_trees(a, b, config);
    const double saved =
        cost_of_pairs(a, b, match_trees(a, b, 1.5), config) - cost_of_pairs(a, b, pairs, config);
    EXPECT_GE(saved, 0.0);
    less += saved;
    std::vector<bool> free_a(a.size(), true);
    std::vector<bool> free_b(b.size(), true);
    for (const auto& [i, j] : pairs)
      free_a[i] = free_b[j] = false;
    for (std::size_t i = 0; i < a.size(); ++i)
      for (std::size_t j = 0; j < b.size(); ++j)
        EXPECT_FALSE(free_a[i] && free_b[j] && std::hypot(a[i].x - b[j].x, a[i].y - b[j].y) < 1.5);
    // From the other side the cost of the pairs is the same: it is the best.
    std::vector<TreePair> back;
    for (const auto& [j, i] : assign_trees(b, a, config))
      back.emplace_back(i, j);
    EXPECT_NEAR(cost_of_pairs(a, b, back, config), cost_of_pairs(a, b, pairs, config), 1e-9);
  }
  EXPECT_GT(less, 50.0);
}

TEST(TreeMatching, ListsWithTheSamePlaceTooOftenAreRefused) {
  const std::vector<Tree> heap(50, stem(1.0, 2.0));
  EXPECT_THROW((void)assign_trees(heap, heap, {0.5, 0.3, 2000}), InputError);
  EXPECT_EQ(assign_trees(heap, heap, {0.5, 0.3, 2500}).size(), 50U);
}

TEST(TreeMatching, ErrorsByDiameterCountEveryTreeOnce) {
  const std::vector<Tree> b = {stem(0, 0, 0.12), stem(5, 0, 0.18), stem(9, 0, 0.30), stem(15, 0)};
  std::vector<Tree> a = {stem(0.1, 0, 0.21), stem(9, 0.2, 0.28), stem(30, 0, 0.25),
                         stem(15, 0.1, 0.2)};
  a[0].stem_volume_m3 = 0.5;
  const auto pairs = assign_trees(a, b, {});
  const auto classes = errors_by_diameter(a, b, pairs, 0.1);
  ASSERT_EQ(classes.size(), 3U);
  // The tree of 21 cm belongs to its partner of 12 cm.
  EXPECT_DOUBLE_EQ(classes[0].from_m, 0.1);
  EXPECT_EQ(classes[0].errors.trees_a, 1U);
  EXPECT_EQ(classes[0].errors.trees_b, 2U);
  EXPECT_DOUBLE_EQ(classes[0].errors.recall, 0.5);
  EXPECT_NEAR(classes[0].errors.dbh_bias_m, 0.09, 1e-12);
  EXPECT_NEAR(classes[0].errors.x_bias_m, 0.1, 1e-12);
  EXPECT_TRUE(std::isnan(classes[0].errors.volume_rmse_m3));
  // A false tree of 25 cm.
  EXPECT_EQ(classes[1].errors.trees_b, 0U);
  EXPECT_DOUBLE_EQ(classes[1].errors.precision, 0.0);
  // 0.30 lies on a border and is within the class that begins there.
  EXPECT_DOUBLE_EQ(classes[2].from_m, 3 * 0.1);
  EXPECT_DOUBLE_EQ(classes[2].errors.recall, 1.0);
  EXPECT_NEAR(classes[2].errors.y_bias_m, 0.2, 1e-12);
  EXPECT_THROW((void)errors_by_diameter({stem(0, 0, 300.0)}, b, {}, 0.1), InputError);
}

TEST(TreeMatching, OverlappingTreesAreThoseWhoseStemsTouch) {
  // Radii of 10 and 20 cm: 30 cm apart they touch, 31 cm apart they do not. P4 section 3.4.1.
  const std::vector<Tree> b = {stem(0, 0, 0.4), stem(10, 0, 0.4), stem(20, 0), stem(30, 0, 0.3)};
  const std::vector<Tree> a = {stem(0.3, 0, 0.2), stem(10.31, 0, 0.2), stem(20.05, 0, 0.2)};
  const TreeErrors errors = errors_of_pairs(a, b, assign_trees(a, b, {}));
  EXPECT_EQ(errors.matched, 3U);
  EXPECT_EQ(errors.overlapping, 2U);
  EXPECT_DOUBLE_EQ(errors.overlapping_tree_ratio, 0.5);
}

}  // namespace
}  // namespace understory
