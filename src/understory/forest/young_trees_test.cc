#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "understory/forest/inventory.h"
#include "understory/forest/test_plot.h"

namespace understory {
namespace {

TEST(YoungTrees, GreenToTheGroundAreListedByAFullInventory) {
  TestPlot plot(8);
  plot.slope_x = 0.1;
  plot.add_ground(20.0, 60);
  plot.add_stem({3.0, 3.0, 0.3});
  const std::vector<Eigen::Vector2d> places = {{6.0, 6.0}, {7.3, 6.2}, {12.0, 9.0}, {10.0, 15.0}};
  for (const Eigen::Vector2d& place : places)
    plot.add_young_tree(place.x(), place.y(), 0.035, 3.2);
  const InventoryResult full = take_inventory(blocks_of(plot.cloud), {});
  EXPECT_EQ(full.trees.size(), places.size() + 1);
  for (const Eigen::Vector2d& place : places) {
    const Tree* tree = nearest(full.trees, place.x(), place.y());
    ASSERT_NE(tree, nullptr) << place.transpose();
    EXPECT_LT(std::hypot(tree->x - place.x(), tree->y - place.y()), 0.06);
    EXPECT_NEAR(tree->dbh_m, 0.035, 2.0 * tree->dbh_sd_m);
    EXPECT_GT(tree->dbh_sd_m, 0.01);
    EXPECT_NEAR(tree->height_m, 3.2, 0.2);
  }
  // Another view would hardly tell more of a stem that is as thin as the noise.
  for (const LookAgain& place : full.look_again) {
    for (const int id : place.trees)
      EXPECT_FALSE(full.stems.at(static_cast<std::size_t>(id) - 1).in_foliage) << id;
  }
  // A map's own list begins at 5 cm.
  const InventoryResult basic = take_inventory(blocks_of(plot.cloud), basic_inventory());
  EXPECT_LT(basic.trees.size(), full.trees.size());
  for (const Tree& tree : basic.trees)
    EXPECT_GE(tree.dbh_m, 0.05);
}

// A tree of 2.2 m is thinner than that.
TEST(YoungTrees, DenseFoliageOfSeedlingsIsNoStem) {
  TestPlot plot(10);
  plot.add_ground(16.0, 60);
  plot.add_stem({3.0, 3.0, 0.3});
  plot.add_young_tree(6.0, 6.0, 0.05, 2.2);
  plot.add_young_tree(11.0, 9.0, 0.05, 4.4, 5'000);
  const InventoryResult full = take_inventory(blocks_of(plot.cloud), {});
  EXPECT_EQ(full.trees.size(), 2U);
  ASSERT_NE(nearest(full.trees, 11.0, 9.0), nullptr);
}

// Where the cloud was cut off, tops are not those of the trees.
TEST(YoungTrees, OfACloudThatWasCutOffHaveNoHeight) {
  TestPlot plot(9);
  plot.add_ground(12.0, 60);
  plot.add_stem({3.0, 3.0, 0.3});
  plot.add_young_tree(6.0, 6.0, 0.03, 4.5, 5'000);
  plot.add_young_tree(9.0, 4.0, 0.03, 4.8, 5'000);
  const Tree* tree = nullptr;
  const InventoryResult whole = take_inventory(blocks_of(plot.cloud), {});
  tree = nearest(whole.trees, 6.0, 6.0);
  ASSERT_NE(tree, nullptr);
  EXPECT_NEAR(tree->height_m, 4.5, 0.2);
  std::erase_if(plot.cloud, [&](const Eigen::Vector3d& point) {
    return point.z() - plot.ground(point.x(), point.y()) > 2.9;
  });
  const InventoryResult cut = take_inventory(blocks_of(plot.cloud), {});
  tree = nearest(cut.trees, 6.0, 6.0);
  ASSERT_NE(tree, nullptr);
  EXPECT_TRUE(std::isnan(tree->height_m)) << tree->height_m;
}

}  // namespace
}  // namespace understory
