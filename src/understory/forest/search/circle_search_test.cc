#include "understory/forest/search/circle_search.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/util/random.h"

namespace understory {
namespace {

using Slice = std::vector<Eigen::Vector2f>;

// Part of a circle, from `from_deg` on, and the points on it.
struct Arc {
  double x = 0.0;
  double y = 0.0;
  double radius = 0.1;
  double from_deg = 0.0;
  double arc_deg = 360.0;
  int count = 60;
  double noise_m = 0.002;
};

void add_arc(Slice& slice, const Arc& arc, Random& random) {
  for (int i = 0; i < arc.count; ++i) {
    const double angle = (arc.from_deg + arc.arc_deg * (i + 0.5) / arc.count) * M_PI / 180.0;
    const double r = arc.radius + random.normal(0.0, arc.noise_m);
    slice.emplace_back(static_cast<float>(arc.x + r * std::cos(angle)),
                       static_cast<float>(arc.y + r * std::sin(angle)));
  }
}

TEST(CircleSearch, TwoStemsAreTwoCircles) {
  Random random(1);
  Slice slice;
  add_arc(slice, {2.0, 3.0, 0.15, 0.0, 360.0, 120, 0.003}, random);
  add_arc(slice, {4.0, 3.5, 0.08, 180.0, 170.0, 60, 0.003}, random);
  const auto found = find_circles({slice}, {}, 7);
  ASSERT_EQ(found.size(), 1U);
  ASSERT_EQ(found[0].size(), 2U);
  const bool first_is_large = found[0][0].radius_m > found[0][1].radius_m;
  const Circle& large = found[0][first_is_large ? 0 : 1];
  const Circle& small = found[0][first_is_large ? 1 : 0];
  EXPECT_LT((large.centre - Eigen::Vector2d(2.0, 3.0)).norm(), 0.003);
  EXPECT_NEAR(large.radius_m, 0.15, 0.003);
  EXPECT_GT(large.arc_deg, 345.0);
  EXPECT_NEAR(large.rms_m, 0.003, 0.0015);
  EXPECT_EQ(large.inside, 0);
  EXPECT_LT((small.centre - Eigen::Vector2d(4.0, 3.5)).norm(), 0.006);
  EXPECT_NEAR(small.radius_m, 0.08, 0.006);
  EXPECT_NEAR(small.arc_deg, 170.0, 25.0);
}

// A stem is empty inside; a ring within foliage is not.
TEST(CircleSearch, PointsWithinACircleAreCounted) {
  Random random(2);
  Slice slice;
  add_arc(slice, {0.0, 0.0, 0.3, 0.0, 360.0, 200, 0.002}, random);
  add_arc(slice, {0.0, 0.0, 0.1, 0.0, 360.0, 25, 0.002}, random);
  Circle start;
  start.radius_m = 0.3;
  const Circle circle = refine_circle(slice, start, 0.02);
  EXPECT_EQ(circle.inside, 25);
  EXPECT_EQ(circle.on, 200);
}

TEST(CircleSearch, ATooSmallArcOrTooFewPointsAreNoCircle) {
  Random random(3);
  Slice arc;
  add_arc(arc, {0.0, 0.0, 0.3, 0.0, 30.0, 40, 0.001}, random);
  EXPECT_TRUE(find_circles({arc}, {}, 7)[0].empty());
  Slice few;
  add_arc(few, {0.0, 0.0, 0.05, 0.0, 360.0, 4, 0.0}, random);
  EXPECT_TRUE(find_circles({few}, {}, 7)[0].empty());
  EXPECT_TRUE(find_circles({Slice()}, {}, 7)[0].empty());
}

TEST(CircleSearch, SlicesAreAnsweredInTheirOrder) {
  Random random(4);
  std::vector<Slice> slices(3);
  add_arc(slices[0], {0.0, 0.0, 0.1, 0.0, 360.0, 60, 0.002}, random);
  add_arc(slices[2], {1.0, 1.0, 0.2, 0.0, 360.0, 60, 0.002}, random);
  const auto found = find_circles(slices, {}, 7);
  ASSERT_EQ(found.size(), 3U);
  ASSERT_EQ(found[0].size(), 1U);
  EXPECT_TRUE(found[1].empty());
  ASSERT_EQ(found[2].size(), 1U);
  EXPECT_NEAR(found[0][0].radius_m, 0.1, 0.003);
  EXPECT_NEAR(found[2][0].radius_m, 0.2, 0.003);
}

// Points of a neighbour do not draw the circle along.
TEST(CircleSearch, RefiningLeavesOutWhatIsFarFromTheCircle) {
  Random random(5);
  Slice slice;
  add_arc(slice, {0.0, 0.0, 0.2, 90.0, 180.0, 90, 0.004}, random);
  add_arc(slice, {0.5, 0.0, 0.2, 0.0, 360.0, 90, 0.004}, random);
  Circle start;
  start.centre = {0.02, -0.01};
  start.radius_m = 0.21;
  const Circle circle = refine_circle(slice, start, 0.04);
  EXPECT_LT(circle.centre.norm(), 0.004);
  EXPECT_NEAR(circle.radius_m, 0.2, 0.003);
  EXPECT_GE(circle.on, 85);
  EXPECT_LE(circle.on, 100);
  EXPECT_EQ(refine_circle({}, start, 0.04).on, 0);
}

// A spoilt map hangs together as one group with a stem in every square metre and much between them.
Slice spoilt_stand(int stems_a_side, Random& random) {
  Slice slice;
  for (int i = 0; i < stems_a_side; ++i) {
    for (int k = 0; k < stems_a_side; ++k) {
      add_arc(slice, {i + 0.3, k + 0.4, random.uniform(0.08, 0.3), 0.0, 360.0, 60, 0.004}, random);
    }
  }
  const int scattered = 300 * stems_a_side * stems_a_side;
  for (int i = 0; i < scattered; ++i) {
    slice.emplace_back(static_cast<float>(random.uniform(0.0, stems_a_side)),
                       static_cast<float>(random.uniform(0.0, stems_a_side)));
  }
  return slice;
}

// Each circle once took as long as the whole group is large: 1,900 passes over each point in a
// group of 420,000, against 36 in one of 4,700.
TEST(CircleSearch, TheWorkInAHugeGroupIsNearlyProportionalToItsPoints) {
  Random random(6);
  std::vector<double> work_per_point;
  for (const int side : {8, 24}) {
    const Slice slice = spoilt_stand(side, random);
    std::uint64_t work = 0;
    EXPECT_GT(find_circles({slice}, {}, 7, {}, &work)[0].size(), 0.5 * side * side);
    work_per_point.push_back(static_cast<double>(work) / static_cast<double>(slice.size()));
  }
  RecordProperty("work_per_point", std::to_string(work_per_point[1]));
  EXPECT_LT(work_per_point[1], 2.0 * work_per_point[0]);
  EXPECT_LT(work_per_point[1], 500.0);
}

}  // namespace
}  // namespace understory
