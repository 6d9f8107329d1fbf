#include "understory/forest/ground/ground.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "understory/forest/test_plot.h"
#include "understory/util/random.h"

namespace understory {
namespace {

TEST(Ground, LiesUnderStemsAndBushesOnASlope) {
  TestPlot plot(1);
  plot.slope_x = 0.4;
  plot.bump_m = 0.6;
  plot.add_ground(20.0, 40);
  for (int i = 0; i < 8; ++i)
    plot.add_bush(2.0 + 2.2 * i, 3.0 + 1.8 * i, 0.9, 2000);
  plot.add_stem({10.0, 4.0, 0.4});
  const GroundModel model = estimate_ground(blocks_of(plot.cloud), {});
  double squares = 0.0;
  double worst = 0.0;
  int count = 0;
  for (double x = 1.0; x < 19.0; x += 0.7) {
    for (double y = 1.0; y < 19.0; y += 0.7) {
      const double error = model.terrain.interpolate(x, y) - plot.ground(x, y);
      ASSERT_TRUE(std::isfinite(error));
      squares += error * error;
      worst = std::max(worst, std::abs(error));
      ++count;
    }
  }
  EXPECT_LT(std::sqrt(squares / count), 0.04);
  EXPECT_LT(worst, 0.25);
}

TEST(Ground, AStrayPointDeepBelowDoesNotPullItDown) {
  TestPlot plot(2);
  plot.add_ground(10.0, 40);
  plot.cloud.emplace_back(5.0, 5.0, 90.0);
  const GroundModel model = estimate_ground(blocks_of(plot.cloud), {});
  EXPECT_NEAR(model.terrain.interpolate(5.0, 5.0), 100.0, 0.05);
  EXPECT_EQ(model.las_class(model.height_above({5.0, 5.0, 90.0})), 7);
  EXPECT_EQ(model.las_class(model.height_above({5.0, 5.0, 100.01})), 2);
  EXPECT_EQ(model.las_class(model.height_above({5.0, 5.0, 101.5})), 4);
}

// A tilted lidar with crosstalk over many scans: ghosts below every cell, spread over the depth.
TEST(Ground, GhostsBelowEveryCellDoNotPullItDown) {
  TestPlot plot(4);
  plot.slope_x = 0.5;
  plot.add_ground(20.0, 1500);
  Random random(5);
  for (int i = 0; i < 2000; ++i) {
    const double x = random.uniform(0.0, 20.0);
    const double y = random.uniform(0.0, 20.0);
    plot.cloud.emplace_back(x, y, plot.ground(x, y) - random.uniform(0.5, 40.0));
  }
  const GroundModel model = estimate_ground(blocks_of(plot.cloud), {});
  double squares = 0.0;
  double worst = 0.0;
  int count = 0;
  for (double x = 1.0; x < 19.0; x += 0.5) {
    for (double y = 1.0; y < 19.0; y += 0.5) {
      const double error = model.terrain.interpolate(x, y) - plot.ground(x, y);
      squares += error * error;
      worst = std::max(worst, std::abs(error));
      ++count;
    }
  }
  EXPECT_LT(std::sqrt(squares / count), 0.03);
  EXPECT_LT(worst, 0.4);  // a ghost just below its cell may stay
}

// Cells of the border have no neighbours beyond it. One row of the raster follows the other in
// memory, and the other end of a row lies 12 m higher or lower.
TEST(Ground, AGapAtTheBorderOfTheRasterIsFilledFromItsOwnSide) {
  for (const double low : {0.0, 18.0}) {
    TestPlot plot(7);
    plot.slope_x = 0.6;
    plot.add_ground(20.0, 40);
    std::erase_if(plot.cloud, [&](const Eigen::Vector3d& point) {
      return point.x() >= low && point.x() < low + 2.0 && std::abs(point.y() - 10.0) < 2.0;
    });
    const GroundModel model = estimate_ground(blocks_of(plot.cloud), {});
    for (double x = low + 0.3; x < low + 1.8; x += 0.3)
      EXPECT_NEAR(model.terrain.interpolate(x, 10.0), plot.ground(x, 10.0), 1.2) << x;
  }
}

TEST(Ground, NothingIsInventedFarFromTheGround) {
  TestPlot plot(3);
  plot.add_ground(10.0, 40);
  plot.cloud.emplace_back(60.0, 5.0, 130.0);
  const GroundModel model = estimate_ground(blocks_of(plot.cloud), {});
  EXPECT_TRUE(std::isnan(model.terrain.interpolate(35.0, 5.0)));
  EXPECT_TRUE(std::isnan(estimate_ground(blocks_of({}), {}).height_above({0.0, 0.0, 0.0})));
}

// Ground to x = 30 m. Behind it only stems are seen, whose lowest points rise above the ground.
TestPlot stems_behind_an_edge(double slope_x) {
  TestPlot plot(6);
  plot.slope_x = slope_x;
  plot.add_ground(30.0, 40);
  for (double x = 31.0; x < 60.0; x += 1.5) {
    for (double y = 0.5; y < 30.0; y += 1.5)
      plot.cloud.emplace_back(x, y, plot.ground(x, y) + 0.25 * (x - 29.0));
  }
  return plot;
}

TEST(Ground, DoesNotRiseToStemsBehindAnEdge) {
  const TestPlot plot = stems_behind_an_edge(0.0);
  const GroundModel model = estimate_ground(blocks_of(plot.cloud), {});
  for (double x = 31.0; x < 59.0; x += 1.0)
    EXPECT_NEAR(model.terrain.interpolate(x, 15.0), plot.ground(x, 15.0), 0.5) << x;
}

// Filled in level, the terrain would lie above them.
TEST(Ground, HasNoHoleBehindAnEdgeAndLiesBelowAllThatIsSeen) {
  const TestPlot plot = stems_behind_an_edge(-0.3);
  const GroundModel model = estimate_ground(blocks_of(plot.cloud), {});
  for (double x = 31.0; x < 59.0; x += 1.0) {
    const double z = model.terrain.interpolate(x, 15.0);
    ASSERT_TRUE(std::isfinite(z)) << x;
    EXPECT_LT(z, plot.ground(x, 15.0) + 0.25 * (x - 29.0) + 0.2) << x;
  }
}

}  // namespace
}  // namespace understory
