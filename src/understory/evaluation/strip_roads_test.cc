#include "understory/evaluation/strip_roads.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "understory/evaluation/trees/tree_rates.h"

namespace understory {
namespace {

// Two roads of 100 m, 22 m apart, there and back, with a half circle between them.
struct Drive {
  std::vector<StemView> views;
  std::vector<Pose> poses;
};

Drive drive() {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> along(-30.0, 130.0);
  std::uniform_real_distribution<double> across(-30.0, 52.0);
  std::vector<Eigen::Vector3d> trees;
  while (trees.size() < 700) {
    const Eigen::Vector3d tree(along(random), across(random), 0.0);
    bool free = true;
    for (const Eigen::Vector3d& other : trees)
      free &= (other - tree).norm() > 1.5;
    if (free) trees.push_back(tree);
  }
  std::vector<Eigen::Vector3d> path;
  for (int k = 0; k <= 100; ++k)
    path.emplace_back(k, 0.5 * std::sin(0.1 * k), 0.0);
  for (int k = 1; k < 34; ++k)
    path.emplace_back(100.0 + 11.0 * std::sin(k * M_PI / 34.0),
                      11.0 - 11.0 * std::cos(k * M_PI / 34.0), 0.0);
  for (int k = 100; k >= 0; --k)
    path.emplace_back(k, 22.0, 0.0);
  Drive result;
  for (std::size_t i = 0; i < path.size(); ++i) {
    result.poses.emplace_back(Eigen::Quaterniond::Identity(), path[i]);
    StemView view;
    view.frame = static_cast<int>(i);
    for (const Eigen::Vector3d& tree : trees) {
      if ((tree - path[i]).norm() > 25.0) continue;
      Stem stem;
      stem.point = (tree - path[i]).cast<float>();
      view.stems.push_back(stem);
    }
    result.views.push_back(view);
  }
  return result;
}

TEST(StripRoads, AreFoundWithoutTheTurnBetween) {
  const std::vector<StripRoad> roads = find_strip_roads(drive().poses, {});
  ASSERT_EQ(roads.size(), 2U);
  EXPECT_LT(roads[0].first, 3U);
  EXPECT_NEAR(static_cast<double>(roads[0].last), 100.0, 8.0);
  EXPECT_NEAR(static_cast<double>(roads[1].first), 134.0, 8.0);
  EXPECT_GT(roads[1].last, 231U);
}

TEST(StripRoads, AgreeWhereTheyArePlacedRightly) {
  const Drive seen = drive();
  const auto result = road_consistencies(seen.views, seen.poses, {});
  ASSERT_EQ(result.size(), 1U);
  EXPECT_GT(result[0].trees, 100U);
  // A few trees at the corners lie beyond the range of one road's views.
  EXPECT_GT(result[0].as_placed, 0.95);
  EXPECT_GT(result[0].in_parts, 0.95);
  EXPECT_LT(result[0].match_rms_m, 1e-4);
}

TEST(StripRoads, ADriftBetweenThemShowsAndOneMotionTakesItAway) {
  Drive seen = drive();
  const Pose shift(Eigen::Quaterniond(Eigen::AngleAxisd(0.004, Eigen::Vector3d::UnitZ())),
                   {0.5, 0.3, 0.0});
  for (std::size_t i = 118; i < seen.poses.size(); ++i)
    seen.poses[i] = shift * seen.poses[i];
  const auto result = road_consistencies(seen.views, seen.poses, {});
  ASSERT_EQ(result.size(), 1U);
  EXPECT_LT(result[0].as_placed, 0.5);
  EXPECT_GT(result[0].moved, 0.97);
  EXPECT_GT(result[0].in_parts, 0.95);
}

TEST(StripRoads, MissingTreesCount) {
  Drive seen = drive();
  // Every fifth tree of the second road's views is felled before it comes.
  for (std::size_t i = 118; i < seen.views.size(); ++i) {
    std::erase_if(seen.views[i].stems, [&](const Stem& stem) {
      const Eigen::Vector3d at = seen.poses[i] * stem.point.cast<double>();
      return static_cast<long>(std::floor(at.x() * 7.0 + at.y() * 13.0)) % 5 == 0;
    });
  }
  const auto result = road_consistencies(seen.views, seen.poses, {});
  ASSERT_EQ(result.size(), 1U);
  EXPECT_NEAR(result[0].as_placed, 0.8 / 0.9, 0.05);
  EXPECT_NEAR(consistency(80, 100, 80), 80.0 / 90.0, 1e-12);
}

}  // namespace
}  // namespace understory
