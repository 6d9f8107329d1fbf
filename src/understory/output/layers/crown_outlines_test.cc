#include "understory/output/layers/crown_outlines.h"

#include <gtest/gtest.h>
#include <ogrsf_frmts.h>

#include <string>

#include "understory/output/layers/layer_files.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

double area_m2(const CrownOutline& crown) {
  double sum = 0.0;
  for (const PlaneRing& ring : crown.rings)
    sum += signed_area_m2(ring);
  return sum;
}

// A tree with a stem, and a canopy with the crowns A to C. A has a hole and a part that touches it
// at a corner alone; B is no tree of the list. A fourth crown has no cell.
InventoryResult stem_and_canopy() {
  InventoryResult inventory;
  inventory.trees.resize(5);
  for (std::size_t i = 0; i < inventory.trees.size(); ++i)
    inventory.trees[i].id = static_cast<int>(i) + 1;
  inventory.trees[0].crown_area_m2 = 12.0;
  inventory.trees[0].crown_base_m = 6.5;
  inventory.crown_outlines = {{{0.0, 0.0}, {4.0, 0.0}, {4.0, 3.0}, {0.0, 3.0}}, {}};
  const std::string rows[] = {"AAA.BB", "A.A.BB", "AAA...", "...ACC"};  // from the south
  CanopyCrowns canopy;
  canopy.crowns.resize(4);
  canopy.canopy.x0 = 100.0;
  canopy.canopy.y0 = 200.0;
  canopy.canopy.cell_m = 0.5;
  canopy.canopy.columns = 6;
  canopy.canopy.rows = 4;
  for (const std::string& row : rows) {
    for (const char cell : row)
      canopy.owner.push_back(cell == '.' ? CanopyCrowns::kNone : cell - 'A');
  }
  canopy.canopy.values.assign(canopy.owner.size(), 10.0F);
  inventory.crowns = canopy;
  inventory.crown_ids = {3, 0, 4, 5};
  return inventory;
}

TEST(CrownOutlines, StemsHaveConvexOnesAndCanopiesThoseOfTheirCells) {
  const std::vector<CrownOutline> outlines = crown_outlines(stem_and_canopy());
  ASSERT_EQ(outlines.size(), 3U) << "the second stem has no crown, the fifth tree no cell";
  EXPECT_EQ(outlines[0].tree, 1);
  EXPECT_EQ(area_m2(outlines[0]), 12.0);
  EXPECT_EQ(outlines[1].tree, 3);
  EXPECT_EQ(area_m2(outlines[1]), 9 * 0.25);
  EXPECT_EQ(outlines[1].rings.size(), 3U) << "outer ring, its hole, and the part beside it";
  EXPECT_EQ(outlines[2].tree, 4);
  EXPECT_EQ(area_m2(outlines[2]), 2 * 0.25);
  for (const Eigen::Vector2d& corner : outlines[2].rings.at(0)) {
    EXPECT_GE(corner.x(), 102.0);
    EXPECT_LE(corner.x(), 103.0);
    EXPECT_GE(corner.y(), 201.5) << "row 0 lies in the south";
    EXPECT_LE(corner.y(), 202.0);
  }
}

TEST(CrownOutlines, ABasicInventoryHasNone) {
  InventoryResult inventory;
  inventory.trees.resize(2);
  EXPECT_TRUE(crown_outlines(inventory).empty());
}

TEST(CrownOutlines, AreALayerOfTheTreesPackage) {
  const test::TemporaryFolder folder;
  write_tree_layers(folder.path(), stem_and_canopy(), {}, LayerFrame(), {});
  GDALAllRegister();
  const GDALDatasetUniquePtr dataset(
      GDALDataset::Open((folder / "trees.gpkg").c_str(), GDAL_OF_VECTOR | GDAL_OF_READONLY));
  ASSERT_NE(dataset, nullptr);
  OGRLayer* layer = dataset->GetLayerByName("crowns");
  ASSERT_NE(layer, nullptr);
  EXPECT_EQ(layer->GetFeatureCount(), 3);
  const OGRFeatureUniquePtr stem(layer->GetNextFeature());
  EXPECT_EQ(stem->GetFieldAsInteger("tree_id"), 1);
  EXPECT_EQ(stem->GetFieldAsDouble("crown_area_m2"), 12.0);
  EXPECT_EQ(stem->GetFieldAsDouble("crown_base_m"), 6.5);
  EXPECT_FALSE(stem->IsFieldSetAndNotNull(stem->GetFieldIndex("crown_volume_m3")));
  EXPECT_EQ(stem->GetGeometryRef()->toMultiPolygon()->get_Area(), 12.0);
  const OGRFeatureUniquePtr holed(layer->GetNextFeature());
  EXPECT_EQ(holed->GetGeometryRef()->toMultiPolygon()->get_Area(), 9 * 0.25);
  EXPECT_TRUE(holed->GetGeometryRef()->IsValid());
}

// On the globe the outline lies where the layers do, of the same size.
TEST(CrownOutlines, GoIntoTheFrameOfTheLayers) {
  const LayerFrame layers(Pose(), {61.2, 24.7, 150.0}, "EPSG:3067");
  const std::vector<CrownOutline> local = crown_outlines(stem_and_canopy());
  std::vector<Tree> trees = stem_and_canopy().trees;
  for (Tree& tree : trees)
    tree.z = 3.0;
  const std::vector<CrownOutline> placed = crowns_in(layers, local, trees);
  ASSERT_EQ(placed.size(), local.size());
  EXPECT_NEAR(area_m2(placed[0]), 12.0, 0.03);
  const Eigen::Vector2d& corner = local[0].rings[0][1];
  const Eigen::Vector3d expected = layers.exact_from_world({corner.x(), corner.y(), 3.0});
  EXPECT_LT((placed[0].rings[0][1] - expected.head<2>()).norm(), 1e-3);
}

}  // namespace
}  // namespace understory
