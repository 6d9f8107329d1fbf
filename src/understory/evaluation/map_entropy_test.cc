#include "understory/evaluation/map_entropy.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <numbers>
#include <set>
#include <vector>

#include "understory/util/parallel.h"
#include "understory/util/random.h"

namespace understory {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

std::filesystem::path folder() {
  return std::filesystem::path(::testing::TempDir()) / "map_entropy_tiles";
}

// A wall of 4 x 2 m over two tiles, its points off it by `sd_m`.
std::vector<Vector3d> wall(double sd_m, int count, std::uint64_t seed) {
  Random random(seed);
  std::vector<Vector3d> points;
  for (int k = 0; k < count; ++k)
    points.emplace_back(random.uniform(8.0, 12.0), random.normal(0.0, sd_m),
                        random.uniform(0.0, 2.0));
  return points;
}

MapEntropy entropy_of(const std::vector<Vector3d>& points) {
  MapEntropyMeter meter(folder(), {});
  for (const Vector3d& point : points)
    meter.add(point);
  return meter.measure();
}

// The definition, point by point against all others.
MapEntropy by_definition(const std::vector<Vector3d>& points, const MapEntropyConfig& config) {
  MapEntropy result;
  double sum = 0.0;
  for (const Vector3d& centre : points) {
    std::vector<Vector3d> near;
    for (const Vector3d& other : points) {
      if ((other - centre).norm() < config.radius_m) near.push_back(other);
    }
    ++result.points;
    if (static_cast<int>(near.size()) < config.fewest_neighbours) continue;
    Vector3d mean = Vector3d::Zero();
    for (const Vector3d& point : near)
      mean += point / static_cast<double>(near.size());
    Matrix3d covariance = config.least_sd_m * config.least_sd_m * Matrix3d::Identity();
    for (const Vector3d& point : near)
      covariance += (point - mean) * (point - mean).transpose() / static_cast<double>(near.size());
    ++result.points_used;
    sum += 0.5 * std::log((2.0 * std::numbers::pi * std::numbers::e * covariance).determinant());
  }
  result.mean_entropy_nats = sum / static_cast<double>(result.points_used);
  return result;
}

TEST(MapEntropy, IsTheDefinitionOverTheBordersOfTiles) {
  std::vector<Vector3d> points = wall(0.02, 800, 3);
  points.emplace_back(-30.0, 5.0, 1.0);  // alone
  const MapEntropy expected = by_definition(points, {});
  const MapEntropy found = entropy_of(points);
  EXPECT_EQ(found.points, 801U);
  EXPECT_EQ(found.points_used, expected.points_used);
  EXPECT_LT(found.points_used, 801U);
  EXPECT_NEAR(found.mean_entropy_nats, expected.mean_entropy_nats, 1e-4);
}

// A wall that is twice as thick has ln 2 more.
TEST(MapEntropy, GrowsWithTheLogarithmOfTheThickness) {
  const MapEntropy thin = entropy_of(wall(0.01, 20'000, 4));
  const MapEntropy thick = entropy_of(wall(0.02, 20'000, 4));
  EXPECT_NEAR(thick.mean_entropy_nats - thin.mean_entropy_nats, std::log(2.0), 0.02);
  EXPECT_NEAR(std::sqrt(thin.mean_plane_variance_m2), 0.01, 5e-4);
}

// The first point of each cube, by hand; and the entropy of these.
TEST(MapEntropy, ThinnedItIsThatOfTheFirstPointOfEachCube) {
  const std::vector<Vector3d> points = wall(0.02, 6'000, 6);
  MapEntropyConfig config;
  config.thin_m = 0.05;
  std::set<std::array<long, 3>> taken;
  std::vector<Vector3d> first;
  for (const Vector3d& point : points) {
    const Eigen::Array3d cube = (point / config.thin_m).array().floor();
    if (taken.insert({std::lround(cube.x()), std::lround(cube.y()), std::lround(cube.z())}).second)
      first.push_back(point);
  }
  MapEntropyMeter meter(folder(), config);
  for (const Vector3d& point : points)
    meter.add(point);
  const MapEntropy found = meter.measure();
  const MapEntropy expected = by_definition(first, config);
  EXPECT_LT(first.size(), points.size() - 1000);
  EXPECT_EQ(found.points, points.size());
  EXPECT_EQ(found.points_used, expected.points_used);
  EXPECT_NEAR(found.mean_entropy_nats, expected.mean_entropy_nats, 1e-4);
}

TEST(MapEntropy, IsTheSameForAnyNumberOfThreadsAndOfNothingIsUnknown) {
  const std::vector<Vector3d> points = wall(0.01, 5'000, 5);
  double one = 0.0;
  double four = 0.0;
  with_threads(1, [&] { one = entropy_of(points).mean_entropy_nats; });
  with_threads(4, [&] { four = entropy_of(points).mean_entropy_nats; });
  EXPECT_EQ(one, four);
  EXPECT_FALSE(std::filesystem::exists(folder()));
  EXPECT_TRUE(std::isnan(entropy_of({}).mean_entropy_nats));
}

}  // namespace
}  // namespace understory
