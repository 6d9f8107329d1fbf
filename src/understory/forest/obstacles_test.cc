#include "understory/forest/obstacles.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace understory {
namespace {

using Eigen::Vector3d;

ObstacleConfig config() {
  ObstacleConfig config;
  config.enabled = true;
  config.reach_m = 5.0;
  config.least_height_m = 1.0;
  config.cell_m = 0.5;
  return config;
}

double free_at(const ObstacleMap& map, double x, double y) {
  return map.free_height().cell_value(x, y);
}

TEST(ObstacleMap, TheLowestObstacleOfACellIsItsFreeHeight) {
  const std::vector<Vector3d> path = {{0.0, 0.0, 4.0}, {20.0, 0.0, 4.0}};
  ObstacleMap map(config(), path);
  EXPECT_TRUE(map.add({1.1, 1.1, 103.0}, 3.0));
  EXPECT_TRUE(map.add({1.2, 1.2, 102.2}, 2.2));
  EXPECT_TRUE(map.add({1.3, 1.3, 102.9}, 2.9));
  EXPECT_NEAR(free_at(map, 1.2, 1.2), 2.2, 1e-6);
  EXPECT_TRUE(std::isnan(free_at(map, 1.8, 1.2))) << "nothing stands in the next cell";
}

TEST(ObstacleMap, GrassAndUnknownHeightsAreNone) {
  const std::vector<Vector3d> path = {{0.0, 0.0, 4.0}};
  ObstacleMap map(config(), path);
  EXPECT_FALSE(map.add({1.0, 1.0, 0.9}, 0.9));
  EXPECT_FALSE(map.add({1.0, 1.0, 3.0}, std::nan("")));
  EXPECT_TRUE(std::isnan(free_at(map, 1.0, 1.0)));
}

TEST(ObstacleMap, ReachesAsFarFromThePathAsItShould) {
  const std::vector<Vector3d> path = {{0.0, 0.0, 4.0}, {0.2, 0.0, 4.0}, {20.0, 0.0, 4.0}};
  ObstacleMap map(config(), path);
  EXPECT_TRUE(map.add({20.1, 4.6, 3.0}, 3.0));
  EXPECT_FALSE(map.add({20.1, 5.6, 3.0}, 3.0));
  EXPECT_FALSE(map.add({10.0, 0.0, 3.0}, 3.0)) << "no place of the path is near";
  EXPECT_FALSE(map.add({500.0, 0.0, 3.0}, 3.0));
}

TEST(ObstacleMap, OfNoPathIsEmpty) {
  ObstacleMap map(config(), {});
  EXPECT_FALSE(map.add({0.0, 0.0, 3.0}, 3.0));
  EXPECT_TRUE(map.free_height().empty());
}

TEST(ObstacleMap, CellsGrowWhereThePathIsLong) {
  const std::vector<Vector3d> path = {{0.0, 0.0, 4.0}, {9000.0, 9000.0, 4.0}};
  ObstacleMap map(config(), path);
  EXPECT_EQ(map.free_height().cell_m, 2.0);
  EXPECT_TRUE(map.add({9001.0, 9001.0, 3.0}, 3.0));
}

}  // namespace
}  // namespace understory
