#include "understory/output/inventory_files.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

#include "understory/util/files/csv.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

class InventoryFilesTest : public ::testing::Test {
 protected:
  [[nodiscard]] std::set<std::string> names() const {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder_.path()))
      names.insert(entry.path().filename().string());
    return names;
  }
  static InventoryResult plot() {
    InventoryResult inventory;
    inventory.ground.terrain.columns = inventory.ground.terrain.rows = 2;
    inventory.ground.terrain.values = {1.0F, 1.0F, 1.0F, 1.0F};
    inventory.canopy = inventory.ground.terrain;
    inventory.trees.resize(2);
    return inventory;
  }
  test::TemporaryFolder folder_;
};

TEST_F(InventoryFilesTest, APlotHasTreesTwiceAndAllRasters) {
  write_inventory_files(folder_.path(), plot(), "EPSG:3067");
  EXPECT_EQ(names(),
            (std::set<std::string>{"trees.csv", "trees.gpkg", "dtm.tif", "chm.tif", "dsm.tif"}));
  CsvReader trees(folder_ / "trees.csv");
  EXPECT_TRUE(trees.next() && trees.next());
  EXPECT_FALSE(trees.next());
}

TEST_F(InventoryFilesTest, AFullInventoryHasTheCurvesOfItsStems) {
  InventoryResult inventory = plot();
  inventory.origin = {100.0, 200.0, 0.0};
  inventory.trees[0].id = 7;
  inventory.curves.resize(2);
  inventory.curves[0].sections.push_back({0.1, {1.0, 2.0}, 0.25, 0.01, true});
  write_inventory_files(folder_.path(), inventory, "");
  CsvReader curves(folder_ / "stem_curves.csv");
  ASSERT_TRUE(curves.next());
  EXPECT_EQ(curves.number("tree_id"), 7.0);
  EXPECT_EQ(curves.number("height_m"), 0.1);
  EXPECT_EQ(curves.number("x"), 101.0);
  EXPECT_EQ(curves.number("y"), 202.0);
  EXPECT_EQ(curves.number("diameter_m"), 0.25);
  EXPECT_EQ(curves.number("diameter_sd_m"), 0.01);
  EXPECT_EQ(curves.number("measured"), 1.0);
  EXPECT_FALSE(curves.next());
}

TEST_F(InventoryFilesTest, WhereNothingWasSeenThereIsAnEmptyListAndNoRaster) {
  write_inventory_files(folder_.path(), {}, "");
  EXPECT_EQ(names(), (std::set<std::string>{"trees.csv", "trees.gpkg"}));
}

// The list stays in the frame of the run, the layers lie in the system.
TEST_F(InventoryFilesTest, OfARunOnTheGlobeTheLayersAreInItsSystem) {
  const LayerFrame layers(Pose(), {61.2, 24.7, 150.0}, "EPSG:3067");
  write_inventory_files(folder_.path(), plot(), layers);
  CsvReader trees(folder_ / "trees.csv");
  ASSERT_TRUE(trees.next());
  EXPECT_EQ(trees.number("x"), 0.0);
  EXPECT_EQ(names(),
            (std::set<std::string>{"trees.csv", "trees.gpkg", "dtm.tif", "chm.tif", "dsm.tif"}));
}

TEST_F(InventoryFilesTest, ThePictureTellsGroundFromVegetationByTheTerrain) {
  InventoryResult inventory = plot();
  MapPicture picture(0.5);
  const std::vector<Eigen::Vector3d> points = {{0.25, 0.25, 1.0}, {1.25, 1.25, 9.0}};
  add_to_picture(picture, points, inventory.ground, LayerFrame());
  MapPicture expected(0.5);
  expected.add(0.25, 0.25, 1.0, 0.0);
  expected.add(1.25, 1.25, 9.0, 8.0);
  EXPECT_EQ(picture.png(), expected.png());
}

}  // namespace
}  // namespace understory
