#include "understory/forest/top_judgement.h"

#include <gtest/gtest.h>

#include <vector>

#include "understory/forest/inventory.h"
#include "understory/forest/test_plot.h"

namespace understory {
namespace {

constexpr double kPostTop = 1.8;

// Open ground with one tree, and a post as thick as one. No point is near the post or behind it.
TestPlot plot_with_post() {
  TestPlot plot(7);
  plot.add_ground(30.0, 30);
  plot.add_stem({5.0, 5.0, 0.3});
  plot.add_stem({22.0, 22.0, 0.3});
  std::erase_if(plot.cloud, [&](const Eigen::Vector3d& point) {
    const bool at_post = (point.head<2>() - Eigen::Vector2d(22.0, 22.0)).norm() < 4.0;
    return at_post && point.z() > plot.ground(point.x(), point.y()) + kPostTop;
  });
  return plot;
}

// A scanner between both, that sees up to so many metres above the ground.
Lookouts seeing_up_to(const TestPlot& plot, double height_m) {
  return [&plot, height_m](const Eigen::Vector3d& place) {
    const bool seen = place.z() < plot.ground(place.x(), place.y()) + height_m;
    return std::vector<Eigen::Vector3d>(seen ? 1 : 0, {8.0, 8.0, 101.95});
  };
}

bool lists_the_post(const TestPlot& plot, const Lookouts& lookouts) {
  const InventoryResult result = take_inventory(blocks_of(plot.cloud), {}, {}, lookouts);
  EXPECT_NE(nearest(result.trees, 5.0, 5.0), nullptr);
  return nearest(result.trees, 22.0, 22.0) != nullptr;
}

TEST(TopJudgement, APostThatStandsAloneIsNoTree) {
  const TestPlot plot = plot_with_post();
  EXPECT_FALSE(lists_the_post(plot, seeing_up_to(plot, 40.0)));
}

TEST(TopJudgement, AStemThatEndsWithTheViewMayBeATree) {
  const TestPlot plot = plot_with_post();
  EXPECT_TRUE(lists_the_post(plot, seeing_up_to(plot, kPostTop + 0.1)));
  EXPECT_TRUE(lists_the_post(plot, {}));
}

TEST(TopJudgement, AStemWhoseUpperPartIsHiddenMayBeATree) {
  TestPlot plot = plot_with_post();
  // Branches hang in front of what is above 2 m.
  for (double along = 0.0; along < 7.0; along += 0.05) {
    for (double across = -2.0; across < 2.0; across += 0.1) {
      const double x = 10.0 + 0.7 * (along + across);
      const double y = 10.0 + 0.7 * (along - across);
      plot.cloud.emplace_back(x, y, plot.ground(x, y) + 2.1);
    }
  }
  EXPECT_TRUE(lists_the_post(plot, seeing_up_to(plot, 40.0)));
}

}  // namespace
}  // namespace understory
