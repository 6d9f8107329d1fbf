#include "understory/forest/slice/slice_thinner.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "understory/util/random.h"

namespace understory {
namespace {

std::vector<Eigen::Vector3d> cloud_of(int count, Random& random) {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count; ++i) {
    points.emplace_back(random.uniform(-2.0, 2.0), random.uniform(-2.0, 2.0),
                        random.uniform(0.5, 1.0));
  }
  return points;
}

std::vector<SlicePoint> thinned(const std::vector<Eigen::Vector3d>& points, double cube_m) {
  SliceThinner thinner(cube_m);
  for (const Eigen::Vector3d& point : points)
    thinner.add(point.x(), point.y(), point.z());
  return thinner.take();
}

// Also where the thinner has thinned in between: it does so after a million points.
TEST(SliceThinner, TheOrderOfPointsChangesNoByte) {
  Random random(1);
  std::vector<Eigen::Vector3d> points = cloud_of(1'300'000, random);
  const std::vector<SlicePoint> forward = thinned(points, 0.05);
  std::reverse(points.begin(), points.end());
  const std::vector<SlicePoint> backward = thinned(points, 0.05);
  ASSERT_EQ(forward.size(), backward.size());
  EXPECT_LT(forward.size(), 80'000U);
  std::uint64_t returns = 0;
  for (std::size_t i = 0; i < forward.size(); ++i) {
    ASSERT_EQ(forward[i].x, backward[i].x);
    ASSERT_EQ(forward[i].y, backward[i].y);
    ASSERT_EQ(forward[i].height_m, backward[i].height_m);
    returns += forward[i].returns;
  }
  EXPECT_EQ(returns, points.size());
}

TEST(SliceThinner, APointStandsForTheMeanOfItsCube) {
  const std::vector<SlicePoint> points =
      thinned({{-0.012, 0.001, 1.306}, {-0.002, 0.011, 1.308}, {-0.001, 0.009, 1.307}}, 0.015);
  ASSERT_EQ(points.size(), 1U);
  EXPECT_EQ(points[0].returns, 3U);
  EXPECT_NEAR(static_cast<double>(points[0].x), -0.005, 5e-6);
  EXPECT_NEAR(static_cast<double>(points[0].y), 0.007, 5e-6);
  EXPECT_NEAR(static_cast<double>(points[0].height_m), 1.307, 5e-6);
}

TEST(SliceThinner, MillionsOfPointsAtOnePlaceStayThere) {
  SliceThinner thinner(0.015);
  for (int i = 0; i < 2'500'000; ++i)
    thinner.add(3.331, -7.772, 1.3);
  const std::vector<SlicePoint> points = thinner.take();
  ASSERT_EQ(points.size(), 1U);
  EXPECT_EQ(points[0].returns, 2'500'000U);
  EXPECT_NEAR(static_cast<double>(points[0].x), 3.331, 1e-5);
  EXPECT_NEAR(static_cast<double>(points[0].y), -7.772, 1e-5);
}

}  // namespace
}  // namespace understory
