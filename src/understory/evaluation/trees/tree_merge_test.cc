#include "understory/evaluation/trees/tree_merge.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "understory/evaluation/trees/tree_errors.h"
#include "understory/geometry/plane/delaunay.h"
#include "understory/util/random.h"

namespace understory {
namespace {

std::vector<Tree> square_stand(std::uint64_t seed, int n) {
  Random random(seed);
  std::vector<Tree> trees;
  while (static_cast<int>(trees.size()) < n) {
    Tree tree;
    tree.id = static_cast<int>(trees.size()) + 1;
    tree.x = random.uniform(0.0, 60.0);
    tree.y = random.uniform(0.0, 60.0);
    tree.observations = 10;
    bool free = true;
    for (const Tree& other : trees)
      free = free && std::hypot(other.x - tree.x, other.y - tree.y) > 2.5;
    if (free) trees.push_back(tree);
  }
  return trees;
}

// A map of the same stand that is bent smoothly, up to 0.7 m, with noise and a share missed.
Eigen::Vector2d bend(double x, double y) {
  return {0.5 * std::sin(0.05 * y) + 0.2, 0.4 * std::cos(0.04 * x) - 0.1};
}

std::vector<Tree> bent(const std::vector<Tree>& trees, std::uint64_t seed, double noise_m,
                       double missed) {
  Random random(seed);
  std::vector<Tree> result;
  for (Tree tree : trees) {
    const Eigen::Vector2d by = bend(tree.x, tree.y);
    tree.x += by.x() + noise_m * random.normal();
    tree.y += by.y() + noise_m * random.normal();
    if (!random.chance(missed)) result.push_back(tree);
  }
  return result;
}

// The errata to P1 (7): as printed it maps a constant field to zero.
TEST(TreeMerge, AConstantFieldIsPreservedThoughTreesAreMissing) {
  const std::vector<Tree> s = square_stand(1, 200);
  std::vector<Tree> l;
  for (std::size_t i = 0; i < s.size(); ++i) {
    if (i % 4 == 0) continue;
    l.push_back(s[i]);
    l.back().x += 0.3;
    l.back().y -= 0.4;
  }
  const DeformationField field = deformation_field(s, l, {});
  EXPECT_NEAR(field.mean_m, 0.5, 1e-9);
  for (const Eigen::Vector2d& v : field.smoothed)
    EXPECT_LT((v - Eigen::Vector2d(0.3, -0.4)).norm(), 1e-9);
}

TEST(TreeMerge, TheFieldOfAPathIsThatOfTheTreesBesideIt) {
  const std::vector<Tree> s = square_stand(1, 200);
  const DeformationField field = deformation_field(s, bent(s, 3, 0.0, 0.0), {});
  std::vector<Eigen::Vector2d> path;  // past every tree, half a metre beside it
  for (const Tree& tree : s)
    path.emplace_back(tree.x + 0.5, tree.y);
  path.emplace_back(s[0].x + 1e4, s[0].y);  // nothing is near
  const std::vector<Eigen::Vector2d> along = field_at(s, field, path);
  double off = 0.0;
  double spread = 0.0;
  for (std::size_t k = 0; k < s.size(); ++k) {
    off += (along[k] - field.smoothed[k]).squaredNorm();
    spread += (field.smoothed[0] - field.smoothed[k]).squaredNorm();
  }
  // The bend differs from place to place, and the path takes that of each.
  EXPECT_LT(off, 0.04 * spread);
  EXPECT_EQ(along.back().norm(), 0.0);
}

// Against ((I + D^-1 A) / 2)^(2k) as matrices.
TEST(TreeMerge, SmoothsAsTheMatrixOfTheEquationDoes) {
  const std::vector<Tree> s = square_stand(2, 60);
  const std::vector<Tree> l = bent(s, 3, 0.05, 0.0);
  TreeMergeConfig config;
  config.smoothing = 3;
  const DeformationField field = deformation_field(s, l, config);
  std::vector<Eigen::Vector2d> places;
  for (const Tree& tree : s)
    places.emplace_back(tree.x, tree.y);
  const auto n = static_cast<Eigen::Index>(s.size());
  Eigen::MatrixXd filter = Eigen::MatrixXd::Identity(n, n);
  const auto neighbours = natural_neighbours(places);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto& near = neighbours[static_cast<std::size_t>(i)];
    for (const int j : near)
      filter(i, j) += 1.0 / static_cast<double>(near.size());
  }
  filter *= 0.5;
  Eigen::MatrixXd v(n, 2);
  for (Eigen::Index i = 0; i < n; ++i) {
    ASSERT_EQ(field.paired[static_cast<std::size_t>(i)], 1);
    v.row(i) = field.raw[static_cast<std::size_t>(i)].transpose();
  }
  for (int k = 0; k < 6; ++k)
    v = (filter * v).eval();
  for (Eigen::Index i = 0; i < n; ++i)
    EXPECT_LT((field.smoothed[static_cast<std::size_t>(i)] - v.row(i).transpose()).norm(), 1e-12);
}

TEST(TreeMerge, EndsOfTheWeightHoldOneMapWhereItIs) {
  const std::vector<Tree> s = square_stand(4, 150);
  const std::vector<Tree> l = bent(s, 5, 0.03, 0.2);
  const MergedTrees at_s = merge_trees(s, l, 0.0, {});
  EXPECT_GT(at_s.joined, 110U);
  EXPECT_LE(at_s.trees.size(), s.size() + 5);
  // The field takes nearly all of the bend away: what is left is noise and what smoothing cost.
  EXPECT_LT(at_s.apart_m, 0.15);
  EXPECT_GT(compare_trees(s, l, 1.5).position_rmse_m, 0.3);
  EXPECT_LT(compare_trees(at_s.trees, s, 0.5).position_rmse_m, 0.1);
  const MergedTrees at_l = merge_trees(s, l, 1.0, {});
  EXPECT_LT(compare_trees(at_l.trees, l, 0.5).position_rmse_m, 0.1);
  const MergedTrees between = merge_trees(s, l, 0.5, {});
  const double to_s = compare_trees(between.trees, s, 1.5).position_rmse_m;
  const double to_l = compare_trees(between.trees, l, 1.5).position_rmse_m;
  EXPECT_NEAR(to_s, to_l, 0.08);
}

TEST(TreeMerge, AJoinedTreeKeepsWhatTheSurerKnows) {
  Tree a;
  a.observations = 3;
  a.dbh_m = 0.30;
  a.dbh_sd_m = 0.01;
  Tree b = a;
  b.x = 0.2;
  b.observations = 30;
  b.dbh_m = 0.40;
  b.dbh_sd_m = 0.05;
  b.height_m = 17.0;
  b.missing_since_s = 90.5;
  a.species = "pine";
  a.quality = "good";
  b.quality = "one_side";
  TreeMergeConfig config;
  config.smoothing = 0;
  const MergedTrees merged = merge_trees({a}, {b}, 0.5, config);
  ASSERT_EQ(merged.trees.size(), 1U);
  EXPECT_NEAR(merged.trees[0].x, 0.1, 1e-12);
  EXPECT_EQ(merged.trees[0].observations, 33);
  EXPECT_DOUBLE_EQ(merged.trees[0].dbh_m, 0.30);
  EXPECT_DOUBLE_EQ(merged.trees[0].height_m, 17.0);
  EXPECT_EQ(merged.trees[0].quality, "good") << "that of the diameter";
  EXPECT_EQ(merged.trees[0].species, "pine");
  EXPECT_DOUBLE_EQ(merged.trees[0].missing_since_s, 90.5);
  a.missing_since_s = 60.0;
  EXPECT_DOUBLE_EQ(merge_trees({a}, {b}, 0.5, config).trees[0].missing_since_s, 60.0);
  EXPECT_EQ(merge_trees({}, {b}, 0.5, config).trees.size(), 1U);
  EXPECT_TRUE(merge_trees({}, {}, 0.5, config).trees.empty());
}

}  // namespace
}  // namespace understory
