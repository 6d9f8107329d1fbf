#include "understory/pipeline/mapping/tiled_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "understory/forest/inventory.h"
#include "understory/forest/test_plot.h"
#include "understory/util/files/folder_test_support.h"
#include "understory/util/random.h"

namespace understory {
namespace {

// A strip of 100 m by 12 m with a stem every 4 m.
std::unique_ptr<MapTiles> strip(const std::filesystem::path& folder) {
  TestPlot plot(17);
  plot.bump_m = 0.4;
  Random random(18);
  for (int i = 0; i < 20'000; ++i) {
    const double x = random.uniform(-10.0, 90.0);
    const double y = random.uniform(14.0, 26.0);
    plot.cloud.emplace_back(x, y, plot.ground(x, y) + random.normal(0.0, 0.02));
  }
  for (int i = 0; i < 24; ++i)
    plot.add_stem({-8.0 + 4.0 * i, random.uniform(16.0, 24.0), random.uniform(0.08, 0.3)});
  MapTiles::Config config;
  config.thin_m = 0.0;
  auto tiles = std::make_unique<MapTiles>(folder, config);
  for (const Eigen::Vector3d& p : plot.cloud)
    tiles->add({p.x(), p.y(), p.z(), 1, 1});
  return tiles;
}

std::vector<Eigen::Vector3d> places_in(const TiledMap& map, const GroundArea& area) {
  std::vector<Eigen::Vector3d> places;
  map.in(area, [&](std::span<const Eigen::Vector3d> block) {
    for (const Eigen::Vector3d& place : block) {
      if (area.contains(place.head<2>())) places.push_back(place);
    }
  });
  return places;
}

TEST(TiledMap, IsOnePieceWhereThatHasRoom) {
  const test::TemporaryFolder folder;
  const auto tiles = strip(folder / "tiles");
  for (const double bytes : {0.0, 1e9}) {
    const TiledMap map(*tiles, bytes, folder.path());
    EXPECT_EQ(map.tiles().size(), 1U);
    EXPECT_EQ(map.scratch(), nullptr);
  }
}

TEST(TiledMap, ItsTreesAreThoseOfOnePiece) {
  const test::TemporaryFolder folder;
  const auto tiles = strip(folder / "tiles");
  const TiledMap whole(*tiles, 0.0, folder.path());
  const TiledMap parts(*tiles, 1e5, folder.path());  // the smallest tiles there are
  ASSERT_EQ(parts.tiles().size(), 12U);
  ASSERT_NE(parts.scratch(), nullptr);
  const GroundArea area{{31.0, 15.0}, {47.0, 21.0}};
  EXPECT_EQ(places_in(whole, area), places_in(parts, area));
  EXPECT_GT(places_in(parts, area).size(), 500U);
  InventoryConfig config;
  const InventoryResult one = take_inventory(whole, config);
  const InventoryResult other = take_inventory(parts, config);
  ASSERT_GE(one.trees.size(), 20U);
  ASSERT_EQ(one.trees.size(), other.trees.size());
  for (std::size_t i = 0; i < one.trees.size(); ++i) {
    EXPECT_EQ(one.trees[i].x, other.trees[i].x);
    EXPECT_EQ(one.trees[i].z, other.trees[i].z);
    EXPECT_EQ(one.trees[i].dbh_m, other.trees[i].dbh_m);
    EXPECT_EQ(one.trees[i].height_m, other.trees[i].height_m);
    EXPECT_EQ(one.trees[i].crown_area_m2, other.trees[i].crown_area_m2);
  }
  EXPECT_EQ(one.ground.terrain.values.size(), other.ground.terrain.values.size());
}

}  // namespace
}  // namespace understory
