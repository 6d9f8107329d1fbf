#include <gtest/gtest.h>

#include <vector>

#include "understory/forest/inventory.h"
#include "understory/forest/test_plot.h"
#include "understory/util/median.h"

namespace understory {
namespace {

TEST(Inventory, WideBeamsAreTakenAwayWhereSensorAndPlacesAreKnown) {
  TestPlot plot(23);
  plot.add_ground(20.0, 40);
  plot.add_stem({.x = 6.0, .y = 6.0, .dbh = 0.3, .arc_deg = 180.0});
  InventoryConfig config = basic_inventory();
  const std::vector<Eigen::Vector3d> scanner = {{18.0, 6.0, plot.ground(18.0, 6.0) + 1.3}};
  const Tree bare = take_inventory(blocks_of(plot.cloud), config).trees.at(0);
  const Tree seen = take_inventory(blocks_of(plot.cloud), config, {}, {}, scanner).trees.at(0);
  config.beam.sensor = LidarSensor::kOs1;
  const InventoryResult result = take_inventory(blocks_of(plot.cloud), config, {}, {}, scanner);
  const Tree known = result.trees.at(0);
  EXPECT_EQ(bare.dbh_m, seen.dbh_m);
  const double excess = excess_radius_m(footprint_at(config.beam, 12.0), 0.5 * bare.dbh_m,
                                        result.stems[0].arc_deg, result.stems[0].scatter_m);
  EXPECT_GT(excess, 0.003);
  EXPECT_NEAR(known.dbh_m, bare.dbh_m - 2.0 * excess, 0.001);
  EXPECT_LT(known.dbh_sd_m, seen.dbh_sd_m);
}

TEST(Inventory, TheNoiseOfRangesIsThatOfAllNearStems) {
  TestPlot plot(29);
  plot.add_ground(30.0, 40);
  for (int i = 0; i < 6; ++i)
    plot.add_stem({.x = 3.0 + 2.0 * i, .y = 6.0 + i % 2, .dbh = 0.2 + 0.02 * i, .arc_deg = 200.0});
  plot.add_stem({.x = 26.0, .y = 26.0, .dbh = 0.3, .arc_deg = 200.0});
  InventoryConfig config = basic_inventory();
  config.beam.sensor = LidarSensor::kOs1;
  const std::vector<Eigen::Vector3d> scanner = {{8.0, 10.0, plot.ground(8.0, 10.0) + 1.3}};
  const InventoryResult result = take_inventory(blocks_of(plot.cloud), config, {}, {}, scanner);
  ASSERT_EQ(result.stems.size(), 7u);
  std::vector<double> scatters;
  for (const StemFit& stem : result.stems) {
    if ((stem.centre + result.origin.head<2>()).x() < 20.0) scatters.push_back(stem.scatter_m);
  }
  ASSERT_EQ(scatters.size(), 6u);
  for (const StemFit& stem : result.stems)
    EXPECT_EQ(stem.beam.noise_m, upper_median(scatters));
}

}  // namespace
}  // namespace understory
