#include "understory/forest/trees/tree_segments.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "understory/forest/test_plot.h"

namespace understory {
namespace {

// Flat ground at 100 m.
GroundModel ground() {
  GroundModel ground;
  ground.terrain.columns = ground.terrain.rows = 40;
  ground.terrain.z0 = 100.0;
  ground.terrain.values.assign(1600, 0.0F);
  return ground;
}

std::vector<Tree> trees_of(const std::vector<double>& dbhs) {
  std::vector<Tree> trees;
  for (const double dbh : dbhs) {
    Tree tree;
    tree.id = static_cast<int>(trees.size()) + 1;
    tree.x = 5.0 + 3.0 * static_cast<double>(trees.size());
    tree.y = 20.0;
    tree.z = 100.0;
    tree.dbh_m = dbh;
    trees.push_back(tree);
  }
  return trees;
}

TEST(TreeSegments, PointsAreRelativeToTheFoot) {
  const std::vector<Eigen::Vector3d> points = {
      {5.2, 20.1, 104.0}, {6.4, 20.0, 104.0}, {5.0, 18.9, 101.0}, {5.0, 20.0, 98.0}};
  const auto segments = collect_segments(blocks_of(points), ground(), trees_of({0.3}), 5, 1.0);
  ASSERT_EQ(segments.size(), 1U);
  EXPECT_EQ(segments[0].tree_id, 1);
  ASSERT_EQ(segments[0].points.size(), 1U) << "others are beyond the reach or below the ground";
  EXPECT_LT((segments[0].points[0] - Eigen::Vector3f(0.2F, 0.1F, 4.0F)).norm(), 1e-5F);
}

TEST(TreeSegments, PointsAreThinnedFinerAtBreastHeight) {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 1000; ++i) {
    points.emplace_back(5.0 + 0.0005 * i, 20.0, 101.3);  // half a metre at breast height
    points.emplace_back(5.0 + 0.0005 * i, 20.0, 105.0);
  }
  const auto segments = collect_segments(blocks_of(points), ground(), trees_of({0.3}), 5, 1.0);
  ASSERT_EQ(segments.size(), 1U);
  int low = 0;
  for (const Eigen::Vector3f& point : segments[0].points)
    low += point.z() < 2.0F ? 1 : 0;
  EXPECT_NEAR(low, 0.5 / 0.015, 2.0);
  EXPECT_NEAR(static_cast<double>(segments[0].points.size()) - low, 0.5 / 0.05, 2.0);
}

TEST(TreeSegments, TheTreesChosenAreSpreadOverTheDiameters) {
  const std::vector<Tree> trees = trees_of({0.1, 0.5, 0.2, 0.9, 0.3, 0.8, 0.4, 0.7, 0.6, 1.0});
  const auto segments = collect_segments(blocks_of({}), ground(), trees, 2, 1.0);
  ASSERT_EQ(segments.size(), 2U);
  std::set<double> dbhs;
  for (const TreeSegment& segment : segments)
    dbhs.insert(trees[static_cast<std::size_t>(segment.tree_id) - 1].dbh_m);
  EXPECT_EQ(dbhs, (std::set<double>{0.3, 0.8})) << "one of the thinner and one of the thicker half";
  EXPECT_EQ(collect_segments(blocks_of({}), ground(), trees, 50, 1.0).size(), trees.size());
  EXPECT_TRUE(collect_segments(blocks_of({}), ground(), {}, 5, 1.0).empty());
}

}  // namespace
}  // namespace understory
