#include "understory/forest/search/foliage_columns.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "understory/util/random.h"

namespace understory {
namespace {

SlicePoint point_at(double x, double y, double height_m) {
  return {static_cast<float>(x), static_cast<float>(y), static_cast<float>(height_m), 1};
}

// Leaves to all sides of a place, as dense as those of young pines.
void add_foliage(Random& random, double x, double y, std::vector<SlicePoint>& points) {
  for (int i = 0; i < 1500; ++i) {
    const double turn = random.uniform(0.0, 2.0 * M_PI);
    const double r = 0.6 * std::sqrt(random.uniform());
    points.push_back(
        point_at(x + r * std::cos(turn), y + r * std::sin(turn), random.uniform(0.5, 3.0)));
  }
}

// A stem of 4 cm that leans along x, 12 points in 25 cm.
void add_thin_stem(Random& random, double x, double y, double from_m, double to_m, double slope_x,
                   std::vector<SlicePoint>& points) {
  const int count = static_cast<int>(48.0 * (to_m - from_m));
  for (int i = 0; i < count; ++i) {
    const double turn = random.uniform(0.0, 2.0 * M_PI);
    const double h = random.uniform(from_m, to_m);
    points.push_back(
        point_at(x + slope_x * (h - 1.3) + 0.02 * std::cos(turn) + random.normal(0.0, 0.01),
                 y + 0.02 * std::sin(turn) + random.normal(0.0, 0.01), h));
  }
}

std::vector<StemFit> columns_of(const std::vector<SlicePoint>& points) {
  return find_foliage_columns(points, std::vector<char>(points.size(), 0), {}, {}, {});
}

TEST(FoliageColumns, AStemHiddenInItsOwnBranchesShows) {
  Random random(2);
  std::vector<SlicePoint> points;
  add_foliage(random, 4.0, -7.9, points);
  add_thin_stem(random, 4.0, -7.9, 0.5, 3.0, 0.06, points);
  const std::vector<StemFit> columns = columns_of(points);
  ASSERT_EQ(columns.size(), 1U);
  EXPECT_NEAR(columns[0].centre.x(), 4.0, 0.015);
  EXPECT_NEAR(columns[0].centre.y(), -7.9, 0.015);
  EXPECT_NEAR(columns[0].slope.x(), 0.06, 0.015);
  EXPECT_GE(columns[0].slices.size(), 8U);
}

TEST(FoliageColumns, FoliageAloneHasNone) {
  Random random(3);
  std::vector<SlicePoint> points;
  for (int i = 0; i < 20; ++i)
    add_foliage(random, 1.0 * (i % 5), 1.0 * (i / 5), points);
  EXPECT_TRUE(columns_of(points).empty());
}

TEST(FoliageColumns, WhatShowsOnlyAboveBreastHeightIsNone) {
  Random random(4);
  std::vector<SlicePoint> points;
  add_foliage(random, 0.0, 0.0, points);
  add_thin_stem(random, 0.0, 0.0, 1.6, 3.5, 0.0, points);
  EXPECT_TRUE(columns_of(points).empty());
}

TEST(FoliageColumns, WhatAnotherStemExplainsIsLeftOut) {
  Random random(5);
  std::vector<SlicePoint> points;
  add_foliage(random, 0.0, 0.0, points);
  std::vector<char> explained(points.size(), 0);
  add_thin_stem(random, 0.0, 0.0, 0.5, 3.0, 0.0, points);
  explained.resize(points.size(), 1);
  EXPECT_TRUE(find_foliage_columns(points, explained, {}, {}, {}).empty());
}

TEST(FoliageColumns, FoliageStandsToAllSides) {
  Random random(6);
  StemFit column;
  column.radius_m = 0.02;
  std::vector<SlicePoint> foliage;
  add_foliage(random, 0.0, 0.0, foliage);
  EXPECT_TRUE(stands_in_foliage(foliage, column));
  std::vector<SlicePoint> wall;
  for (int i = 0; i < 3000; ++i)
    wall.push_back(
        point_at(random.uniform(-0.6, 0.6), random.normal(0.0, 0.02), random.uniform(0.5, 3.0)));
  EXPECT_FALSE(stands_in_foliage(wall, column));
}

TEST(FoliageColumns, ALowColumnIsThin) {
  StemFit column;
  column.radius_m = 0.02;
  column.highest_m = 2.2;  // a seedling: 2.7 cm at most
  EXPECT_TRUE(is_too_stout(column, 3.5));
  column.radius_m = 0.013;
  EXPECT_FALSE(is_too_stout(column, 3.5));
  column.radius_m = 0.045;
  column.highest_m = 3.4;  // it goes on
  EXPECT_FALSE(is_too_stout(column, 3.5));
  EXPECT_TRUE(is_too_stout(column, 4.5));
}

}  // namespace
}  // namespace understory
