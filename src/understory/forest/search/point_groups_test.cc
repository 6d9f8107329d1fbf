#include "understory/forest/search/point_groups.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/util/random.h"

namespace understory {
namespace {

using Points = std::vector<Eigen::Vector2f>;

void add_blob(Points& points, const Eigen::Vector2d& place, Random& random) {
  for (int i = 0; i < 40; ++i) {
    points.emplace_back(static_cast<float>(place.x() + random.uniform(-0.1, 0.1)),
                        static_cast<float>(place.y() + random.uniform(-0.1, 0.1)));
  }
}

// A hedge along x.
void add_hedge(Points& points, double from, double to, double y) {
  for (int i = 0; i < static_cast<int>((to - from) / 0.04); ++i)
    points.emplace_back(static_cast<float>(from + 0.04 * i), static_cast<float>(y));
}

TEST(PointGroups, WhatIsFarAwayChangesNeitherPlaceNorPoints) {
  Random random(1);
  Points one;
  add_blob(one, {10.0, 20.0}, random);
  const std::vector<PointGroup> alone = groups_near(one, {});
  ASSERT_EQ(alone.size(), 1U);
  Points more;
  add_blob(more, {-30.0, 3.0}, random);
  more.insert(more.end(), one.begin(), one.end());
  const std::vector<PointGroup> both = groups_near(more, {});
  ASSERT_EQ(both.size(), 2U);
  EXPECT_EQ(both[1].place, alone[0].place);
  EXPECT_NE(both[0].place, alone[0].place);
  EXPECT_EQ(both[1].points, alone[0].points);
}

TEST(PointGroups, AMoveOfTheOriginDoesNotChangeAPlace) {
  Random random(2);
  Points points;
  add_blob(points, {50.0, 70.0}, random);
  Points moved;
  for (const Eigen::Vector2f& point : points)
    moved.emplace_back(point - Eigen::Vector2f(48.0F, 48.0F));
  PointGroupConfig config;
  config.origin = {48.0, 48.0};
  EXPECT_EQ(groups_near(moved, config)[0].place, groups_near(points, {})[0].place);
}

// Of a hedge of 60 m each window holds its own points and those near to it, wherever it ends.
TEST(PointGroups, ALongGroupIsCutByAFixedGrid) {
  Points whole;
  add_hedge(whole, 0.0, 60.0, 3.0);
  Points part;
  add_hedge(part, 12.0, 60.0, 3.0);
  const auto window_at = [](const Points& points, double x) {
    for (const PointGroup& group : groups_near(points, {})) {
      if (group.window.contains({x, 3.0})) return group;
    }
    return PointGroup();
  };
  const PointGroup of_whole = window_at(whole, 36.0);
  EXPECT_EQ(of_whole.window.low, Eigen::Vector2d(32.0, 0.0));
  EXPECT_EQ(of_whole.window.high, Eigen::Vector2d(40.0, 8.0));
  EXPECT_NEAR(static_cast<double>(of_whole.points.size()), (8.0 + 2.6) / 0.04, 2.0);
  EXPECT_EQ(window_at(part, 36.0).points.size(), of_whole.points.size());
  EXPECT_EQ(window_at(part, 36.0).place, of_whole.place);
}

TEST(PointGroups, OnlyGroupsThatReachIntoTheAreaAreGiven) {
  Random random(3);
  Points points;
  add_blob(points, {1.0, 1.0}, random);
  add_blob(points, {9.95, 1.0}, random);
  add_blob(points, {30.0, 1.0}, random);
  add_hedge(points, 0.0, 60.0, 5.0);
  PointGroupConfig config;
  config.area = {{10.0, 0.0}, {12.0, 8.0}};
  const std::vector<PointGroup> groups = groups_near(points, config);
  ASSERT_EQ(groups.size(), 2U);
  EXPECT_NEAR(static_cast<double>(groups[0].points[0].x()), 9.95, 0.11);
  EXPECT_EQ(groups[1].window.low, Eigen::Vector2d(8.0, 0.0));
}

}  // namespace
}  // namespace understory
