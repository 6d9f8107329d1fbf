#include "understory/output/layers/moved_vectors.h"

#include <gtest/gtest.h>
#include <ogrsf_frmts.h>

#include <cmath>
#include <filesystem>

#include "understory/geometry/quiet_gdal.h"
#include "understory/output/layers/layer_files.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

using Eigen::Vector3d;

StandPlot circle_at(double x, double y) {
  StandPlot plot;
  plot.shape = circle_plot("A7", {x, y}, 8.0);
  plot.shape.kind = "circle";
  plot.drawn = plot.shape.rings;
  plot.figures.area_m2 = plot.shape.area_m2();
  plot.figures.trees = 12;
  return plot;
}

Tree tree_at_height(double z) {
  Tree tree;
  tree.id = 1;
  tree.x = 3.0;
  tree.y = 4.0;
  tree.z = z;
  return tree;
}

struct Folders {
  test::TemporaryFolder both;
  std::filesystem::path own = both / "own";
  std::filesystem::path placed = both / "placed";
  Folders() {
    std::filesystem::create_directory(own);
    std::filesystem::create_directory(placed);
  }
};

// A run in its own frame is laid on the globe, turned by half a radian against the clock.
struct PlacedRun {
  Pose motion = Pose(so3_exp(Vector3d(0.0, 0.0, 0.5)), Vector3d(100.0, 50.0, 1.0));
  LayerFrame layers = LayerFrame(Pose(), {61.2, 24.7, 150.0}, "EPSG:3067");
  Folders folders;

  // The trees.gpkg of the placed run.
  GDALDatasetUniquePtr package_of(const InventoryResult& inventory,
                                  const std::vector<StandPlot>& plots) {
    const auto& [both, own, placed] = folders;
    const LayerFrame local;
    write_tree_layers(own, inventory, {}, local, plots);
    write_tree_layers(placed, {tree_at_height(3.0)}, {}, layers);
    add_moved_vectors(own / "trees.gpkg", placed / "trees.gpkg", {local, motion, layers});
    const QuietGdal quiet;
    return GDALDatasetUniquePtr(GDALDataset::Open((placed / "trees.gpkg").c_str(), GDAL_OF_VECTOR));
  }
};

TEST(MovedVectors, PlotsAndPlacesGoWithTheRun) {
  PlacedRun run;
  const auto& [motion, layers, folders] = run;
  LookAgain look;
  look.place = {12.0, -7.0, 2.0};
  look.towards = {0.0, 4.0};  // along the y axis
  look.trees = {5, 2};
  look.unseen_sides = 2;
  InventoryResult inventory;
  inventory.trees = {tree_at_height(2.0)};
  inventory.look_again = {look};
  const GDALDatasetUniquePtr dataset = run.package_of(inventory, {circle_at(10.0, 20.0)});
  ASSERT_NE(dataset, nullptr);
  OGRLayer* plots = dataset->GetLayerByName("plots");
  OGRLayer* looks = dataset->GetLayerByName("look_again");
  ASSERT_NE(plots, nullptr);
  ASSERT_NE(looks, nullptr);
  for (OGRLayer* layer : {plots, looks})
    EXPECT_STREQ(layer->GetSpatialRef()->GetAuthorityCode(nullptr), "3067");

  const OGRFeatureUniquePtr place(looks->GetNextFeature());
  ASSERT_NE(place, nullptr);
  const OGRPoint* point = place->GetGeometryRef()->toPoint();
  EXPECT_LT((Vector3d(point->getX(), point->getY(), point->getZ()) -
             layers.exact_from_world(motion * look.place))
                .norm(),
            1e-3);
  EXPECT_STREQ(place->GetFieldAsString("tree_ids"), "5, 2");
  EXPECT_STREQ(place->GetFieldAsString("reason"), "unseen side");
  // Grid north lies up to 3 degrees beside true north here.
  EXPECT_NEAR(place->GetFieldAsDouble("bearing_deg"), 360.0 - 0.5 * 180.0 / M_PI, 3.0);

  const OGRFeatureUniquePtr plot(plots->GetNextFeature());
  ASSERT_NE(plot, nullptr);
  const Vector3d centre = motion * Vector3d(10.0, 20.0, 2.0);
  OGRPoint middle;
  plot->GetGeometryRef()->toMultiPolygon()->Centroid(&middle);
  const Vector3d expected = layers.exact_from_world(centre);
  EXPECT_NEAR(middle.getX(), expected.x(), 0.01);
  EXPECT_NEAR(middle.getY(), expected.y(), 0.01);
  EXPECT_NEAR(plot->GetGeometryRef()->toMultiPolygon()->get_Area(), M_PI * 64.0, 0.3);
  EXPECT_NEAR(plot->GetFieldAsDouble("x"), centre.x(), 1e-3);
  EXPECT_NEAR(plot->GetFieldAsDouble("y"), centre.y(), 1e-3);
  EXPECT_STREQ(plot->GetFieldAsString("plot"), "A7");
  EXPECT_EQ(plot->GetFieldAsDouble("trees"), 12.0);
}

TEST(MovedVectors, DeadWoodGoesWithTheRun) {
  PlacedRun run;
  const auto& [motion, layers, folders] = run;
  DeadWood stump;
  stump.kind = DeadWoodKind::kStump;
  stump.from = {4.0, 3.0, 2.0};
  stump.to = {4.0, 3.0, 2.5};
  DeadWood log;
  log.from = {1.0, 2.0, 3.0};
  log.to = {7.0, -2.0, 3.5};
  log.diameter_m = 0.3;
  InventoryResult inventory;
  inventory.trees = {tree_at_height(2.0)};
  inventory.dead_wood = {stump, log};
  const GDALDatasetUniquePtr dataset = run.package_of(inventory, {});
  ASSERT_NE(dataset, nullptr);
  const auto expect_at = [&](const OGRPoint& point, const Vector3d& world) {
    EXPECT_LT((Vector3d(point.getX(), point.getY(), point.getZ()) -
               layers.exact_from_world(motion * world))
                  .norm(),
              1e-3);
  };
  for (const auto& [name, id] : {std::pair{"stumps", 1}, std::pair{"logs", 2}}) {
    OGRLayer* layer = dataset->GetLayerByName(name);
    ASSERT_NE(layer, nullptr) << name;
    const OGRFeatureUniquePtr row(layer->GetNextFeature());
    ASSERT_NE(row, nullptr);
    EXPECT_EQ(row->GetFieldAsInteger("id"), id);
    if (id == 1) {
      expect_at(*row->GetGeometryRef()->toPoint(), stump.from);
      EXPECT_NEAR(row->GetFieldAsDouble("height_m"), 0.5, 1e-9);
      continue;
    }
    const OGRLineString& line = *row->GetGeometryRef()->toLineString();
    ASSERT_EQ(line.getNumPoints(), 2);
    OGRPoint end;
    line.getPoint(0, &end);
    expect_at(end, log.from);
    line.getPoint(1, &end);
    expect_at(end, log.to);
    EXPECT_NEAR(row->GetFieldAsDouble("length_m"), log.length_m(), 1e-9);
  }
}

TEST(MovedVectors, CrownsGoWithTheRun) {
  PlacedRun run;
  const auto& [motion, layers, folders] = run;
  InventoryResult inventory;
  inventory.trees = {tree_at_height(2.0)};
  inventory.trees[0].crown_base_m = 7.5;
  inventory.crown_outlines = {{{1.0, 2.0}, {5.0, 2.0}, {5.0, 7.0}, {1.0, 7.0}}};
  const GDALDatasetUniquePtr dataset = run.package_of(inventory, {});
  ASSERT_NE(dataset, nullptr);
  OGRLayer* crowns = dataset->GetLayerByName("crowns");
  ASSERT_NE(crowns, nullptr);
  EXPECT_STREQ(crowns->GetSpatialRef()->GetAuthorityCode(nullptr), "3067");
  const OGRFeatureUniquePtr crown(crowns->GetNextFeature());
  ASSERT_NE(crown, nullptr);
  EXPECT_EQ(crown->GetFieldAsInteger("tree_id"), 1);
  EXPECT_EQ(crown->GetFieldAsDouble("crown_base_m"), 7.5);
  const OGRMultiPolygon& shape = *crown->GetGeometryRef()->toMultiPolygon();
  OGRPoint middle;
  shape.Centroid(&middle);
  const Vector3d expected = layers.exact_from_world(motion * Vector3d(3.0, 4.5, 2.0));
  EXPECT_NEAR(middle.getX(), expected.x(), 0.01);
  EXPECT_NEAR(middle.getY(), expected.y(), 0.01);
  EXPECT_NEAR(shape.get_Area(), 20.0, 0.05);
}

TEST(MovedVectors, WhatIsNotThereLeavesThePackageAsItIs) {
  const Folders folders;
  const auto& [both, own, placed] = folders;
  const LayerFrame local;
  write_tree_layers(placed, {tree_at_height(3.0)}, {}, local);
  add_moved_vectors(own / "trees.gpkg", placed / "trees.gpkg", {local, Pose(), local});
  write_tree_layers(own, {tree_at_height(3.0)}, {}, local);
  add_moved_vectors(own / "trees.gpkg", placed / "trees.gpkg", {local, Pose(), local});
  const QuietGdal quiet;
  const GDALDatasetUniquePtr dataset(
      GDALDataset::Open((placed / "trees.gpkg").c_str(), GDAL_OF_VECTOR));
  ASSERT_NE(dataset, nullptr);
  EXPECT_EQ(dataset->GetLayerCount(), 1);
}

}  // namespace
}  // namespace understory
