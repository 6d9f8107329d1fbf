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
  const double excess =
      excess_radius_m(footprint_at(config.beam, 12.0), 0.5 * bare.dbh_m, result.stems[0].arc_deg);
  EXPECT_GT(excess, 0.003);
  EXPECT_NEAR(known.dbh_m, bare.dbh_m - 2.0 * excess, 0.001);
  EXPECT_LT(known.dbh_sd_m, seen.dbh_sd_m);
}

}  // namespace
}  // namespace understory
