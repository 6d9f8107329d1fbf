#include "understory/forest/ground/low_noise.h"

#include <gtest/gtest.h>

#include <vector>

#include "understory/forest/test_plot.h"

namespace understory {
namespace {

// Ground of a slope, 20 x 20 m, with 16 points on each square metre.
Cloud sloping_cloud() {
  Cloud points;
  for (int j = 0; j < 80; ++j) {
    for (int i = 0; i < 80; ++i)
      points.emplace_back(0.25 * i, 0.25 * j, 300.0 + 0.05 * i);
  }
  return points;
}

TEST(LowNoise, GhostsFarBelowTheGroundAreNoise) {
  Cloud points = sloping_cloud();
  for (int i = 0; i < 10; ++i)
    points.emplace_back(5.0 + 0.01 * i, 5.0, 260.0 + 3.7 * i);  // spread over the depth
  const LowNoise noise(blocks_of(points));
  for (std::size_t i = points.size() - 10; i < points.size(); ++i)
    EXPECT_TRUE(noise.holds(points[i])) << points[i].z();
}

TEST(LowNoise, NothingOfTheGroundIsNoise) {
  const Cloud points = sloping_cloud();
  const LowNoise noise(blocks_of(points));
  for (const Eigen::Vector3d& point : points)
    ASSERT_FALSE(noise.holds(point)) << point.transpose();
  EXPECT_FALSE(noise.holds({5.0, 5.0, 320.0})) << "nor what stands on it";
  EXPECT_TRUE(noise.holds({5.0, 5.0, 299.0}));
}

// A regression: twenty points at 0, 0 of a cloud in map coordinates asked for all memory.
TEST(LowNoise, PointsAtTheOriginOfTheMapAskForNoMemory) {
  Cloud points = sloping_cloud();
  for (Eigen::Vector3d& point : points)
    point += Eigen::Vector3d(400e3, 6800e3, 0.0);
  for (int i = 0; i < 50; ++i)
    points.emplace_back(0.0, 0.0, 0.0);
  const LowNoise noise(blocks_of(points));
  EXPECT_FALSE(noise.holds(points.front()));
}

TEST(LowNoise, WhereNothingIsKnownNothingIsNoise) {
  const Cloud points = sloping_cloud();
  const LowNoise noise(blocks_of(points));
  EXPECT_FALSE(noise.holds({500.0, 500.0, 0.0}));
}

// Heights are counted in spans of 32 m. Two points on each side of an end make one layer.
TEST(LowNoise, ALayerGoesOnFromSpanToSpan) {
  const Cloud points = {
      {0.5, 0.5, 0.0}, {0.5, 0.5, 31.8}, {0.5, 1.5, 31.9}, {1.5, 0.5, 32.1}, {1.5, 1.5, 32.2}};
  const LowNoise noise(blocks_of(points));
  EXPECT_TRUE(noise.holds(points[0])) << "alone, far under the layer";
  for (std::size_t i = 1; i < points.size(); ++i)
    EXPECT_FALSE(noise.holds(points[i])) << points[i].z();
}

}  // namespace
}  // namespace understory
