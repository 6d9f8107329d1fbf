#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "understory/simulation/scene/crown_shapes.h"
#include "understory/simulation/scene/scene.h"
#include "understory/simulation/scene/terrain.h"
#include "understory/simulation/simulator.h"
#include "understory/simulation/stand/stand.h"
#include "understory/simulation/stand/stand_drawing.h"
#include "understory/util/angles.h"
#include "understory/util/random.h"

namespace understory {
namespace {

TEST(Ground, HasSlopesDitchesAndSnowThatHidesThem) {
  TerrainConfig config;
  config.relief_m = config.hummock_m = config.roughness_m = 0.0;
  config.slope_deg = 30.0;
  config.slope_azimuth_deg = 0.0;
  const Terrain steep(config, 40.0, 40.0, 1);
  EXPECT_NEAR(std::atan2(steep.height(10.0, 0.0) - steep.height(-10.0, 0.0), 20.0), 30.0 * kDegree,
              1e-9);
  config.slope_deg = 0.0;
  config.ditches = 1;
  config.ditch_depth_m = 0.8;
  const Terrain ditch(config, 40.0, 40.0, 1);
  EXPECT_NEAR(ditch.height(0.0, 0.0), -0.8, 0.05);
  EXPECT_NEAR(ditch.height(0.0, 8.0), 0.0, 0.01);
  config.ditches = 0;
  config.hummock_m = 0.15;
  const auto unevenness = [](const Terrain& terrain) {
    double sum = 0.0;
    for (double x = -30.0; x < 30.0; x += 0.9)
      sum += std::pow(terrain.height(x, 1.0), 2.0);
    return std::sqrt(sum / 67.0);
  };
  const double bare = unevenness(Terrain(config, 40.0, 40.0, 1));
  config.snow_m = 0.5;
  EXPECT_LT(unevenness(Terrain(config, 40.0, 40.0, 1)), 0.3 * bare);
  CarrierConfig carrier;
  carrier.length_m = 60.0;
  const Route route(carrier, 1);
  config.track_depth = 0.5;
  config.hummock_m = 0.0;
  config.cell_m = 0.1;
  const Terrain pressed(config, 40.0, 40.0, 1, &route);
  double deepest = 0.0;
  for (double across = -1.5; across <= 1.5; across += 0.05) {
    const double heading = route.heading(30.0);
    const Eigen::Vector2d place =
        route.place(30.0) + across * Eigen::Vector2d(-std::sin(heading), std::cos(heading));
    deepest = std::min(deepest, pressed.height(place.x(), place.y()));
  }
  EXPECT_NEAR(deepest, -0.25, 0.03);
}

// A stem seen along a level ray at a height above its foot: the two edges' distance.
double width_at(const SiteConfig& site, const GrownTree& tree, double height,
                double* offset = nullptr) {
  const Terrain terrain(site.terrain, 30.0, 30.0, 1);
  Stand stand;
  stand.trees = {tree};
  const ForestScene scene(site.stand, terrain, stand, 1);
  double low = 1e9;
  double high = -1e9;
  for (double y = -3.0; y <= 3.0; y += 0.002) {
    Ray ray;
    ray.origin =
        Eigen::Vector3f(-8.0F, static_cast<float>(y), static_cast<float>(tree.foot.z() + height));
    ray.direction = Eigen::Vector3f::UnitX();
    Hit hit;
    scene.cast(&ray, 1, 0.1F, 20.0F, &hit);
    if (hit.surface != Surface::kStem) continue;
    low = std::min(low, y);
    high = std::max(high, y);
  }
  if (offset != nullptr) *offset = 0.5 * (low + high);
  return high < low ? 0.0 : high - low;
}

TEST(Trees, ForkInTwoAndBreakOff) {
  SiteConfig site;
  site.terrain.relief_m = site.terrain.hummock_m = site.terrain.slope_deg = 0.0;
  site.terrain.roughness_m = 0.0;
  site.stand.foliage = site.stand.dead_branches = 0.0;
  GrownTree tree;
  tree.id = 1;
  tree.dbh_m = 0.3;
  tree.height_m = 18.0;
  tree.crown_base_m = 9.0;
  tree.crown_radius_m = 1.5;
  tree.yaw_rad = std::numbers::pi / 2.0;  // the second stem leaves to the side
  const double plain = width_at(site, tree, 6.0);
  EXPECT_NEAR(plain, tree.diameter(6.0), 0.006);
  tree.fork_m = 2.0;
  EXPECT_NEAR(width_at(site, tree, 1.3), 0.3, 0.006);  // below the fork nothing changes
  EXPECT_GT(width_at(site, tree, 6.0), plain + 0.5);
  tree.fork_m = 0.0;
  tree.broken_m = 5.0;
  EXPECT_GT(width_at(site, tree, 4.5), 0.2);
  EXPECT_EQ(width_at(site, tree, 6.0), 0.0);
}

// Pines of one height differ in where their branches begin, and the shape that stands for a tree's
// crown begins there too. The lowest branches are thinner than those above.
TEST(Trees, CrownsBeginAtTheirHeightsAndFrayOut) {
  StandConfig config;
  const GrownShapes grown = grow_shapes(config, 1);
  config.pine_share = 1.0;
  config.spruce_share = 0.0;
  Random random(4);
  std::vector<double> shares;
  double apart = 0.0;
  for (int id = 1; id <= 300; ++id) {
    GrownTree tree = draw_tree(config, random);
    tree.id = id;
    const GrownCrown& crown = grown.crowns[nearest_crown(grown.crowns, tree)];
    ASSERT_EQ(crown.species, Species::kPine);
    shares.push_back(tree.crown_base_m / tree.height_m);
    apart += std::abs(crown.size.crown_base_m / crown.size.height_m - shares.back()) / 300.0;
  }
  std::sort(shares.begin(), shares.end());
  EXPECT_LT(shares[30], 0.36);
  EXPECT_GT(shares[270], 0.50);
  EXPECT_LT(apart, 0.04);
  const GrownCrown& tall = grown.crowns[8];  // a pine of 14 m
  ASSERT_EQ(tall.size.height_m, 14.0);
  const double length = tall.size.height_m - tall.size.crown_base_m;
  double area[4] = {0.0, 0.0, 0.0, 0.0};  // by quarters of the crown
  for (const Eigen::Vector3i& triangle : tall.living.triangles) {
    const Eigen::Vector3f& a = tall.living.vertices[static_cast<std::size_t>(triangle.x())];
    const Eigen::Vector3f& b = tall.living.vertices[static_cast<std::size_t>(triangle.y())];
    const Eigen::Vector3f& c = tall.living.vertices[static_cast<std::size_t>(triangle.z())];
    const double up = (static_cast<double>(a.z()) - tall.size.crown_base_m) / length;
    area[std::clamp(static_cast<int>(4.0 * up), 0, 3)] +=
        0.5 * static_cast<double>((b - a).cross(c - a).norm());
  }
  EXPECT_GT(area[0], 0.1 * area[1]);
  EXPECT_LT(area[0], area[1]);
  EXPECT_LT(area[0], area[2]);
}

TEST(Stands, HaveTheSharesOfForksBreaksAndBoulders) {
  SiteConfig site = load_site(
      "demo", {"stand.size_x_m=150", "stand.size_y_m=150", "stand.fork_share=0.2",
               "stand.broken_share=0.1", "stand.boulders_per_ha=200", "stand.buildings=2"});
  const Route route(site.carrier, 1);
  const Terrain terrain(site.terrain, 87.0, 87.0, 1);
  const Stand stand = grow_stand(site.stand, site.carrier, terrain, route, 1);
  double forks = 0.0;
  double breaks = 0.0;
  for (const GrownTree& tree : stand.trees) {
    forks += tree.fork_m > 0.0 ? 1.0 : 0.0;
    breaks += tree.broken_m > 0.0 ? 1.0 : 0.0;
  }
  const auto trees = static_cast<double>(stand.trees.size());
  EXPECT_NEAR(forks / trees, 0.18, 0.03);  // broken trees lose their fork
  EXPECT_NEAR(breaks / trees, 0.1, 0.02);
  EXPECT_GT(stand.boulders.size(), 350U);
  EXPECT_EQ(stand.buildings.size(), 2U);
  for (const Wood& boulder : stand.boulders)
    EXPECT_GT(route.distance_to(boulder.from.head<2>()), boulder.radius_from_m);
}

}  // namespace
}  // namespace understory
