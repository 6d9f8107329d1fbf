#include "understory/output/plot_files.h"

#include <gdal_priv.h>
#include <gtest/gtest.h>
#include <ogrsf_frmts.h>

#include <cmath>
#include <string>

#include "understory/geometry/quiet_gdal.h"
#include "understory/output/layers/geo_files.h"
#include "understory/util/files/csv.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

StandTable table() {
  StandTable stand;
  stand.seen.seen_m2 = stand.seen.area_m2 = 1'000.0;
  stand.seen.stems_per_ha = {870.0, 12.5};
  StandPlot plot;
  plot.shape = circle_plot("A \"1\", west", {100.0, 200.0}, 9.0);
  plot.drawn = plot.shape.rings;
  plot.figures.trees = 17;
  plot.figures.stems_per_ha = {668.0, 21.0};
  plot.figures.classes = {{0.10, 0.12, 5, {196.5, 30.0}, {1.9, 0.3}}};
  stand.plots.push_back(plot);
  StandPlot holed;
  holed.shape.id = "B";
  holed.shape.kind = "polygon";
  holed.shape.rings = {{{0, 0}, {10, 0}, {10, 10}, {0, 10}}, {{4, 4}, {4, 6}, {6, 6}, {6, 4}}};
  holed.drawn = holed.shape.rings;
  stand.plots.push_back(holed);
  return stand;
}

TEST(PlotFiles, ATableOfPlotsAndOneOfTheirClasses) {
  const test::TemporaryFolder folder;
  write_plot_tables(folder.path(), table());
  CsvReader plots(folder / "plots.csv");
  ASSERT_TRUE(plots.next());
  EXPECT_EQ(plots.text("plot"), "seen");
  EXPECT_EQ(plots.number("stems_per_ha"), 870.0);
  EXPECT_TRUE(std::isnan(plots.number("x")));
  ASSERT_TRUE(plots.next());
  EXPECT_EQ(plots.text("plot"), "A \"1\", west");
  EXPECT_EQ(plots.text("kind"), "circle");
  EXPECT_EQ(plots.number("x"), 100.0);
  EXPECT_EQ(plots.number("trees"), 17.0);
  EXPECT_EQ(plots.number("stems_per_ha_sd"), 21.0);
  EXPECT_TRUE(std::isnan(plots.number("volume_m3_per_ha")));
  EXPECT_TRUE(std::isnan(plots.number("volume_sd_m3_per_ha"))) << "of no volume";
  ASSERT_TRUE(plots.next());
  EXPECT_EQ(plots.number("x"), 5.0) << "its middle";
  EXPECT_FALSE(plots.next());
  CsvReader classes(folder / "plot_classes.csv");
  ASSERT_TRUE(classes.next());
  EXPECT_EQ(classes.text("plot"), "A \"1\", west");
  EXPECT_EQ(classes.number("dbh_to_m"), 0.12);
  EXPECT_EQ(classes.number("trees"), 5.0);
  EXPECT_FALSE(classes.next());
}

TEST(PlotFiles, TheirOutlinesAreALayerBesideTheTrees) {
  const test::TemporaryFolder folder;
  const std::string file = (folder / "trees.gpkg").string();
  TreeLayers layers;
  layers.plots = table().plots;
  write_trees_gpkg(file, {Tree{}}, "EPSG:3067", layers);
  const QuietGdal quiet;
  const GDALDatasetUniquePtr dataset(
      GDALDataset::Open(file.c_str(), GDAL_OF_VECTOR | GDAL_OF_READONLY));
  ASSERT_NE(dataset, nullptr);
  EXPECT_EQ(dataset->GetLayerCount(), 2);
  OGRLayer* layer = dataset->GetLayerByName("plots");
  ASSERT_NE(layer, nullptr);
  const OGRFeatureUniquePtr circle(layer->GetNextFeature());
  EXPECT_STREQ(circle->GetFieldAsString("plot"), "A \"1\", west");
  EXPECT_EQ(circle->GetFieldAsDouble("stems_per_ha"), 668.0);
  EXPECT_FALSE(circle->IsFieldSetAndNotNull(circle->GetFieldIndex("volume_m3_per_ha")));
  EXPECT_NEAR(circle->GetGeometryRef()->toMultiPolygon()->get_Area(), M_PI * 81.0, 1e-6);
  const OGRFeatureUniquePtr holed(layer->GetNextFeature());
  EXPECT_NEAR(holed->GetGeometryRef()->toMultiPolygon()->get_Area(), 96.0, 1e-9);
  EXPECT_EQ(holed->GetGeometryRef()->toMultiPolygon()->getNumGeometries(), 1);
}

}  // namespace
}  // namespace understory
