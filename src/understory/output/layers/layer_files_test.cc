#include "understory/output/layers/layer_files.h"

#include <gtest/gtest.h>
#include <ogrsf_frmts.h>

#include <cmath>

#include "understory/geometry/quiet_gdal.h"
#include "understory/output/layers/qgis_project.h"
#include "understory/util/files/folder_test_support.h"
#include "understory/util/files/text_file.h"

namespace understory {
namespace {

using Eigen::Vector3d;

const GeodeticPlace kEvo{61.2, 24.7, 150.0};

LayerFrame at_evo(double yaw) {
  return {Pose(so3_exp(Vector3d(0.0, 0.0, yaw)), Vector3d(10.0, 20.0, 1.0)), kEvo, "EPSG:3067"};
}

std::vector<StampedPose> walk() {
  std::vector<StampedPose> path;
  for (int k = 0; k < 50; ++k)
    path.push_back({k * kNsPerSecond, Pose(Eigen::Quaterniond::Identity(),
                                           Vector3d(k < 20 ? 0.001 * k : 0.5 * (k - 20), 0, 1))});
  return path;
}

// A place to look from again, due east of its trees in a world that is turned on the globe.
TEST(LayerFiles, PlacesToLookFromAgainAreALayer) {
  const test::TemporaryFolder folder;
  const LayerFrame layers = at_evo(0.4);
  LookAgain look;
  look.place = {12.0, -7.0, 2.0};
  look.towards = {-3.0, 0.0};
  look.trees = {5, 2};
  look.unseen_sides = 1;
  InventoryResult inventory;
  inventory.look_again = {look};
  write_tree_layers(folder.path(), inventory, {}, layers, {});
  const QuietGdal quiet;
  const GDALDatasetUniquePtr dataset(
      GDALDataset::Open((folder / "trees.gpkg").c_str(), GDAL_OF_VECTOR));
  ASSERT_NE(dataset, nullptr);
  OGRLayer* layer = dataset->GetLayerByName("look_again");
  ASSERT_NE(layer, nullptr);
  EXPECT_STREQ(layer->GetSpatialRef()->GetAuthorityCode(nullptr), "3067");
  const OGRFeatureUniquePtr row(layer->GetNextFeature());
  ASSERT_NE(row, nullptr);
  const OGRPoint* point = row->GetGeometryRef()->toPoint();
  const Vector3d expected = layers.exact_from_world(look.place);
  EXPECT_LT((Vector3d(point->getX(), point->getY(), point->getZ()) - expected).norm(), 1e-3);
  EXPECT_EQ(row->GetFieldAsInteger("trees"), 2);
  EXPECT_STREQ(row->GetFieldAsString("tree_ids"), "5, 2");
  EXPECT_STREQ(row->GetFieldAsString("reason"), "unseen side, few points");
  // West of the world is 270 degrees; the world is turned by 0.4 rad against the clock, and grid
  // north by up to 3 degrees.
  EXPECT_NEAR(row->GetFieldAsDouble("bearing_deg"), 270.0 - 0.4 * 180.0 / M_PI, 3.0);
  write_tree_layers(folder.path(), std::vector<Tree>(), {}, layers);
  const GDALDatasetUniquePtr without(
      GDALDataset::Open((folder / "trees.gpkg").c_str(), GDAL_OF_VECTOR));
  EXPECT_EQ(without->GetLayerByName("look_again"), nullptr) << "nothing to look at";
}

TEST(LayerFiles, TreesAndPathLieInTheSystem) {
  const test::TemporaryFolder folder;
  const LayerFrame layers = at_evo(0.4);
  Tree tree;
  tree.id = 1;
  tree.x = 12.0;
  tree.y = -7.0;
  tree.z = 2.0;
  write_tree_layers(folder.path(), {tree}, walk(), layers);
  const QuietGdal quiet;
  const GDALDatasetUniquePtr dataset(
      GDALDataset::Open((folder / "trees.gpkg").c_str(), GDAL_OF_VECTOR));
  ASSERT_NE(dataset, nullptr);
  for (const char* name : {"trees", "path"}) {
    OGRLayer* layer = dataset->GetLayerByName(name);
    ASSERT_NE(layer, nullptr) << name;
    ASSERT_NE(layer->GetSpatialRef(), nullptr);
    EXPECT_STREQ(layer->GetSpatialRef()->GetAuthorityCode(nullptr), "3067");
  }
  const OGRFeatureUniquePtr first(dataset->GetLayerByName("trees")->GetNextFeature());
  const OGRPoint* point = first->GetGeometryRef()->toPoint();
  const Vector3d expected = layers.exact_from_world({12.0, -7.0, 2.0});
  EXPECT_LT((Vector3d(point->getX(), point->getY(), point->getZ()) - expected).norm(), 1e-3);
  const OGRFeatureUniquePtr line(dataset->GetLayerByName("path")->GetNextFeature());
  EXPECT_NEAR(line->GetFieldAsDouble("length_m"), 14.5, 0.05);
  EXPECT_EQ(line->GetFieldAsDouble("end_s"), 49.0);
  // The 20 poses at rest are one place.
  EXPECT_EQ(line->GetGeometryRef()->toLineString()->getNumPoints(), 30);
}

// A tree is known better along one axis; after a quarter turn along the other.
TEST(LayerFiles, StandardDeviationsTurnWithTheAxes) {
  Tree tree;
  tree.x_sd_m = 0.03;
  tree.y_sd_m = 0.01;
  const std::vector<Tree> turned = trees_in(at_evo(M_PI / 2.0), {tree});
  EXPECT_NEAR(turned[0].x_sd_m, 0.01, 0.002);
  EXPECT_NEAR(turned[0].y_sd_m, 0.03, 0.002);
  EXPECT_EQ(trees_in(LayerFrame(), {tree})[0].x_sd_m, 0.03);
}

TEST(LayerFiles, ACloudInDegreesKeepsMillimetres) {
  const LayerFrame layers(Pose(), kEvo, "EPSG:4326");
  const LasOptions options = las_options(layers);
  EXPECT_LT(options.scale.x() / layers.units_per_metre(), 0.0012);
  EXPECT_EQ(options.offset, Vector3d(25.0, 61.0, 0.0));
  EXPECT_NE(options.crs_wkt.find("WGS 84"), std::string::npos);
  EXPECT_EQ(las_options(LayerFrame()).offset, Vector3d(0.0, 0.0, 0.0));
}

TEST(LayerFiles, AnOctreeIsLeftOutInDegrees) {
  Log log;
  LasOptions metres = las_options(LayerFrame(Pose(), kEvo, "EPSG:3067"));
  ask_for_copc(metres, log);
  EXPECT_TRUE(metres.copc);
  EXPECT_TRUE(log.warnings().empty());
  LasOptions degrees = las_options(LayerFrame(Pose(), kEvo, "EPSG:4326"));
  ask_for_copc(degrees, log);
  EXPECT_FALSE(degrees.copc);
  ASSERT_EQ(log.warnings().size(), 1U);
  EXPECT_EQ(log.warnings()[0].key, "copc.degrees");
}

TEST(QgisProject, ShowsTheOctreeInPlaceOfTheCloud) {
  const std::string text = qgis_project_xml({}, {}, {"map.laz", "map.copc.laz"});
  EXPECT_NE(text.find("<datasource>./map.copc.laz</datasource>"), std::string::npos);
  EXPECT_NE(text.find("<provider encoding=\"UTF-8\">copc</provider>"), std::string::npos);
  EXPECT_EQ(text.find("./map.laz"), std::string::npos);
}

TEST(QgisProject, OpensWhatIsThereByRelativePaths) {
  const std::string text =
      qgis_project_xml({"plot <7>", "PROJCS[\"x\"]", "EPSG:3067", {0, 0, 5, 5}},
                       {"trees", "path", "plots"}, {"trees.gpkg", "dtm.tif", "map.laz"});
  EXPECT_NE(text.find("plot &lt;7&gt;"), std::string::npos);
  EXPECT_NE(text.find("<datasource>./trees.gpkg|layername=path</datasource>"), std::string::npos);
  EXPECT_NE(text.find("<datasource>./dtm.tif</datasource>"), std::string::npos);
  EXPECT_NE(text.find("<authid>EPSG:3067</authid>"), std::string::npos);
  EXPECT_EQ(text.find("chm.tif"), std::string::npos);
  EXPECT_NE(text.find("layername=plots</datasource>"), std::string::npos);
  EXPECT_EQ(text.find("layername=look_again"), std::string::npos);
  EXPECT_EQ(qgis_project_xml({}, {"trees"}, {"trees.gpkg"}).find("layername=path"),
            std::string::npos);
  const test::TemporaryFolder folder;
  LookAgain look;
  look.place = {1.0, 2.0, 3.0};
  InventoryResult inventory;
  inventory.look_again = {look};
  write_tree_layers(folder.path(), inventory, walk(), at_evo(0.0), {});
  write_layer_project(folder.path(), "walk", walk(), at_evo(0.0));
  EXPECT_NE(read_text_file(folder / "map.qgs").find("layername=look_again</datasource>"),
            std::string::npos);
  EXPECT_NE(read_text_file(folder / "map.qgs").find("<xmin>376"), std::string::npos);
}

}  // namespace
}  // namespace understory
