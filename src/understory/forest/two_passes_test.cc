#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "understory/forest/inventory.h"
#include "understory/forest/test_plot.h"
#include "understory/util/random.h"

namespace understory {
namespace {

// Two passes of a scanner, each of one side of all stems, that do not lie on each other.
TestPlot plot_of_two_passes(double apart_m) {
  TestPlot plot(21);
  plot.add_ground(24.0, 40);
  Random random(22);
  for (int i = 0; i < 16; ++i) {
    const double x = 3.0 + 6.0 * (i % 4);
    const double y = 3.0 + 6.0 * (i / 4) + random.uniform(-0.5, 0.5);
    const double radius = random.uniform(0.08, 0.2);
    for (int k = 0; k < 6000; ++k) {
      const double turn = random.uniform(-0.5 * M_PI, 1.5 * M_PI);
      const double shift = turn < 0.5 * M_PI ? apart_m : 0.0;
      const double height = random.uniform(0.05, 8.0);
      const double r = radius - 0.008 * (height - 1.3) + random.normal(0.0, 0.006);
      plot.cloud.emplace_back(x + shift + r * std::cos(turn), y + r * std::sin(turn),
                              plot.ground(x, y) + height);
    }
  }
  return plot;
}

TEST(TwoPasses, PassesThatDoNotLieOnEachOtherAreTold) {
  const InventoryResult good = take_inventory(blocks_of(plot_of_two_passes(0.0).cloud), {});
  ASSERT_EQ(good.trees.size(), 16U);
  EXPECT_EQ(good.two_images, "");
  const InventoryResult apart = take_inventory(blocks_of(plot_of_two_passes(0.06).cloud), {});
  ASSERT_EQ(apart.trees.size(), 16U);
  EXPECT_NE(apart.two_images.find("longer in one direction"), std::string::npos)
      << apart.two_images;
  for (const Tree& tree : apart.trees) {
    const auto same = std::find_if(good.trees.begin(), good.trees.end(), [&](const Tree& other) {
      return std::hypot(other.x - tree.x, other.y - tree.y) < 0.5;
    });
    ASSERT_NE(same, good.trees.end());
    EXPECT_GT(tree.dbh_m, same->dbh_m + 0.02);
    EXPECT_LT(tree.dbh_m, same->dbh_m + 2.0 * tree.dbh_sd_m);
  }
  const InventoryResult twice = take_inventory(blocks_of(plot_of_two_passes(0.5).cloud), {});
  EXPECT_NE(twice.two_images.find("32 of 32 trees stand twice"), std::string::npos)
      << twice.two_images;
  EXPECT_EQ(twice.trees.front().quality, "twice");
}

}  // namespace
}  // namespace understory
