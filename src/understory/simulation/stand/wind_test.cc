#include "understory/simulation/stand/wind.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include "understory/simulation/scene/scene.h"
#include "understory/simulation/scene/terrain.h"

namespace understory {
namespace {

GrownTree tall_tree(double height_m, double dbh_m) {
  GrownTree tree;
  tree.id = 7;
  tree.foot = {3.0, 0.0, 0.0};
  tree.height_m = height_m;
  tree.dbh_m = dbh_m;
  tree.crown_base_m = 0.9 * height_m;
  tree.crown_radius_m = 0.5;
  return tree;
}

TEST(Wind, TopsSwayWithTheirHeightAtTheirOwnPaceAndMostlyAlongTheWind) {
  const Wind wind(0.1);
  const Eigen::Vector2d along(std::cos(0.6), std::sin(0.6));
  for (const double height : {10.0, 20.0}) {
    const Wind::Sway sway = wind.sway_of(tall_tree(height, 0.012 * height));
    double sum = 0.0;
    double across = 0.0;
    int crossings = 0;
    double last = 0.0;
    constexpr int kSamples = 400'000;
    constexpr double kStep = 0.02;
    for (int i = 0; i < kSamples; ++i) {
      const Eigen::Vector2d top = Wind::top(sway, kStep * i);
      const double here = top.dot(along);
      const double aside = along.x() * top.y() - along.y() * top.x();
      sum += here * here;
      across += aside * aside;
      crossings += aside * last < 0.0 ? 1 : 0;
      last = aside;
    }
    const double sd = std::sqrt(sum / kSamples);
    EXPECT_NEAR(sd, 0.1 * height / 15.0, 0.005 * height / 15.0);
    EXPECT_NEAR(std::sqrt(across / kSamples) / sd, 0.6, 0.1);
    // Moore and Maguire: 0.0948 + 3.4317 dbh / height^2.
    const double hertz = 0.0948 + 3.4317 * (1.2 * height) / (height * height);
    EXPECT_NEAR(0.5 * crossings / (kStep * kSamples), hertz, 0.12 * hertz);
  }
}

TEST(Wind, VelocityIsTheChangeOfPlace) {
  const Wind::Sway sway = Wind(0.2).sway_of(tall_tree(18.0, 0.2));
  for (double time = 1.0; time < 20.0; time += 0.7) {
    const Eigen::Vector2d moved =
        (Wind::top(sway, time + 1e-4) - Wind::top(sway, time - 1e-4)) / 2e-4;
    EXPECT_LT((Wind::top_velocity(sway, time) - moved).norm(), 1e-3);
  }
}

struct OneTree {
  explicit OneTree(double sway_m)
      : terrain({.relief_m = 0.0, .slope_deg = 0.0, .hummock_m = 0.0, .roughness_m = 0.0}, 20.0,
                20.0, 1) {
    config.wind_sway_m = sway_m;
    config.foliage = config.dead_branches = 0.0;
    stand.trees = {tall_tree(16.0, 0.22)};
    scene = std::make_unique<ForestScene>(config, terrain, stand, 1);
  }
  // Range from the origin's vertical to the stem at a height, seen so much later than the scene.
  [[nodiscard]] Hit look(double height_m, double aside_m, double later_s) const {
    const Ray ray{{0.0F, static_cast<float>(aside_m), static_cast<float>(height_m)},
                  {1.0F, 0.0F, 0.0F},
                  static_cast<float>(later_s)};
    Hit hit;
    scene->cast(&ray, 1, 0.1F, 20.0F, &hit);
    return hit;
  }
  Terrain terrain;
  StandConfig config;
  Stand stand;
  std::unique_ptr<ForestScene> scene;
};

TEST(Wind, BendsStemsAboveAStiffFoot) {
  OneTree windy(0.3);
  const GrownTree& tree = windy.stand.trees[0];
  const double stiff = stiff_height(tree);
  EXPECT_GE(stiff, 0.2 * 16.0);
  EXPECT_LT(stiff, 4.2);
  const Wind::Sway sway = Wind(0.3).sway_of(tree);
  double largest = 0.0;
  for (double time = 0.0; time < 12.0; time += 1.1) {
    windy.scene->arrange(time, time);
    const Eigen::Vector2d top = Wind::top(sway, time);
    for (const double height : {1.3, 5.0, 9.0, 13.0}) {
      const double share = std::max(0.0, height - stiff) / (16.01 - stiff);
      const Eigen::Vector2d centre = tree.centre(height).head<2>() + share * top;
      const Hit hit = windy.look(height, centre.y(), 0.0);
      ASSERT_EQ(hit.tree, 7) << height;
      EXPECT_NEAR(hit.range_m, centre.x() - 0.5 * tree.diameter(height), 2e-3) << height;
      if (height > 12.0) largest = std::max(largest, share * top.norm());
    }
  }
  EXPECT_GT(largest, 0.2);
}

// A scan takes a tenth of a second: what it sees at its ends has moved on since its middle.
TEST(Wind, StemsSwayDuringAScan) {
  OneTree windy(0.15);
  double moved_sum = 0.0;
  double still_sum = 0.0;
  int looks = 0;
  for (double time = 0.0; time < 40.0; time += 0.37) {
    for (const double later : {-0.05, -0.02, 0.03, 0.05}) {
      windy.scene->arrange(time, time);
      const Hit moved = windy.look(10.0, 0.0, later);
      const Hit still = windy.look(10.0, 0.0, 0.0);
      windy.scene->arrange(time + later, time + later);
      const Hit true_hit = windy.look(10.0, 0.0, 0.0);
      // Near the outline first order is not enough.
      if (true_hit.tree * moved.tree == 0 || true_hit.cosine < 0.8F) continue;
      moved_sum += std::pow(moved.range_m - true_hit.range_m, 2.0);
      still_sum += std::pow(still.range_m - true_hit.range_m, 2.0);
      ++looks;
    }
  }
  EXPECT_GT(looks, 100);
  EXPECT_GT(std::sqrt(still_sum / looks), 0.003);
  EXPECT_LT(std::sqrt(moved_sum / still_sum), 0.15);
}

}  // namespace
}  // namespace understory
