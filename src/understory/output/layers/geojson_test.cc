#include "understory/output/layers/geojson.h"

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "understory/output/layers/geo_files.h"
#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

TEST(GeoJson, PlacesAreLongitudeAndLatitude) {
  const test::TemporaryFolder folder;
  Tree tree;
  tree.id = 4;
  // On the central meridian of zone 35, 27 degrees east; 6,651,411.190 m of it are 60 degrees north
  // (transverse Mercator on GRS 80).
  tree.x = 500000.0;
  tree.y = 6651411.190;
  tree.z = 123.5;
  tree.dbh_m = 0.25;
  write_trees_gpkg(folder / "trees.gpkg", {tree}, "EPSG:3067");
  EXPECT_EQ(write_geojson(folder / "trees.gpkg", "trees", folder / "trees.geojson"), 1U);
  std::ifstream file(folder / "trees.geojson");
  const nlohmann::json json = nlohmann::json::parse(file);
  EXPECT_EQ(json["type"], "FeatureCollection");
  EXPECT_FALSE(json.contains("crs")) << "RFC 7946 has none";
  const auto& feature = json["features"].at(0);
  const auto& place = feature["geometry"]["coordinates"];
  ASSERT_EQ(place.size(), 2U);
  EXPECT_NEAR(place[0].get<double>(), 27.0, 1.1e-7);
  EXPECT_NEAR(place[1].get<double>(), 60.0, 1.1e-7);
  EXPECT_EQ(feature["properties"]["id"], 4);
  EXPECT_DOUBLE_EQ(feature["properties"]["z"].get<double>(), 123.5);
  EXPECT_DOUBLE_EQ(feature["properties"]["dbh_m"].get<double>(), 0.25);
  EXPECT_TRUE(feature["properties"]["height_m"].is_null());
}

TEST(GeoJson, CrownsArePolygons) {
  const test::TemporaryFolder folder;
  Tree tree;
  tree.id = 5;
  TreeLayers layers;
  layers.crowns = {{5, {{{400000.0, 6650000.0}, {400004.0, 6650000.0}, {400004.0, 6650003.0}}}}};
  write_trees_gpkg(folder / "trees.gpkg", {tree}, "EPSG:3067", layers);
  EXPECT_EQ(write_geojson(folder / "trees.gpkg", "crowns", folder / "crowns.geojson"), 1U);
  std::ifstream file(folder / "crowns.geojson");
  const nlohmann::json feature = nlohmann::json::parse(file)["features"].at(0);
  EXPECT_EQ(feature["properties"]["tree_id"], 5);
  EXPECT_EQ(feature["geometry"]["type"], "Polygon") << "of one part";
  const auto& ring = feature["geometry"]["coordinates"].at(0);
  EXPECT_EQ(ring.size(), 4U) << "closed";
  for (const auto& corner : ring) {
    EXPECT_NEAR(corner.at(0).get<double>(), 25.2, 0.2);
    EXPECT_NEAR(corner.at(1).get<double>(), 60.0, 0.1);
  }
}

TEST(GeoJson, WithoutAPlaceOnTheGlobeThereIsNone) {
  const test::TemporaryFolder folder;
  write_trees_gpkg(folder / "trees.gpkg", {Tree{}}, "");
  EXPECT_THROW((void)write_geojson(folder / "trees.gpkg", "trees", folder / "trees.geojson"),
               InputError);
  EXPECT_THROW((void)write_geojson(folder / "trees.gpkg", "crowns", folder / "trees.geojson"),
               InputError);
  EXPECT_THROW((void)write_geojson(folder / "none.gpkg", "trees", folder / "trees.geojson"),
               InputError);
  EXPECT_FALSE(std::filesystem::exists(folder / "trees.geojson"));
  write_trees_gpkg(folder / "trees.gpkg", {Tree{}}, "EPSG:3067");
  EXPECT_THROW(
      (void)write_geojson(folder / "trees.gpkg", "trees", folder / "none" / "trees.geojson"),
      OutputError);
}

}  // namespace
}  // namespace understory
