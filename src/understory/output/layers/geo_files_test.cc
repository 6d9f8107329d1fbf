#include "understory/output/layers/geo_files.h"

#include <gdal_priv.h>
#include <gtest/gtest.h>
#include <ogrsf_frmts.h>

#include <array>
#include <cmath>
#include <limits>

#include "understory/util/error.h"
#include "understory/util/files/atomic_file.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

class GeoFilesTest : public ::testing::Test {
 protected:
  static Raster two_by_three() {
    Raster raster;
    raster.x0 = 400'000.0;
    raster.y0 = 7'000'000.0;
    raster.cell_m = 2.0;
    raster.columns = 2;
    raster.rows = 3;
    raster.z0 = 1234.5;
    raster.values = {0.25F, 1.25F, 2.25F, 3.25F, 4.25F, std::numeric_limits<float>::quiet_NaN()};
    return raster;
  }
  [[nodiscard]] GDALDatasetUniquePtr open(const std::string& name, unsigned kind) const {
    GDALAllRegister();
    return GDALDatasetUniquePtr(GDALDataset::Open((folder_ / name).c_str(), kind));
  }
  // Value of a GeoTIFF at a place, by the transform that the file itself gives.
  static float value_at(GDALDataset& dataset, double x, double y) {
    std::array<double, 6> t{};
    EXPECT_EQ(dataset.GetGeoTransform(t.data()), CE_None);
    const int column = static_cast<int>(std::floor((x - t[0]) / t[1]));
    const int row = static_cast<int>(std::floor((y - t[3]) / t[5]));
    float value = 0.0F;
    EXPECT_EQ(dataset.GetRasterBand(1)->RasterIO(GF_Read, column, row, 1, 1, &value, 1, 1,
                                                 GDT_Float32, 0, 0, nullptr),
              CE_None);
    return value;
  }
  test::TemporaryFolder folder_;
};

TEST_F(GeoFilesTest, EachCellOfARasterLiesWhereItWas) {
  const Raster raster = two_by_three();
  write_geotiff(folder_ / "dtm.tif", raster, "EPSG:3067");
  const auto dataset = open("dtm.tif", GDAL_OF_RASTER);
  ASSERT_NE(dataset, nullptr);
  EXPECT_EQ(dataset->GetRasterXSize(), 2);
  EXPECT_EQ(dataset->GetRasterYSize(), 3);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 2; ++column) {
      const double x = raster.x0 + (column + 0.5) * raster.cell_m;
      const double y = raster.y0 + (row + 0.5) * raster.cell_m;
      const double expected = raster.cell_value(x, y);
      const float found = value_at(*dataset, x, y);
      if (std::isnan(expected)) {
        EXPECT_EQ(found, dataset->GetRasterBand(1)->GetNoDataValue());
      } else {
        EXPECT_FLOAT_EQ(found, static_cast<float>(expected)) << column << " " << row;
      }
    }
  }
  EXPECT_STREQ(dataset->GetRasterBand(1)->GetUnitType(), "metre");
}

TEST_F(GeoFilesTest, ARasterHasTheCoordinateSystemThatWasNamed) {
  write_geotiff(folder_ / "dtm.tif", two_by_three(), "EPSG:3067");
  write_geotiff(folder_ / "local.tif", two_by_three(), "");
  const auto dataset = open("dtm.tif", GDAL_OF_RASTER);
  ASSERT_NE(dataset->GetSpatialRef(), nullptr);
  EXPECT_STREQ(dataset->GetSpatialRef()->GetAuthorityCode(nullptr), "3067");
  EXPECT_EQ(open("local.tif", GDAL_OF_RASTER)->GetSpatialRef(), nullptr);
}

TEST_F(GeoFilesTest, ALargeRasterHasOverviews) {
  Raster large = two_by_three();
  large.columns = 1'300;
  large.rows = 700;
  large.values.assign(1'300 * 700, 2.0F);
  write_geotiff(folder_ / "dtm.tif", large, "EPSG:3067");
  const auto dataset = open("dtm.tif", GDAL_OF_RASTER);
  ASSERT_NE(dataset, nullptr);
  ASSERT_GE(dataset->GetRasterBand(1)->GetOverviewCount(), 1);
  EXPECT_EQ(dataset->GetRasterBand(1)->GetOverview(0)->GetXSize(), 650);
  EXPECT_STREQ(dataset->GetMetadataItem("LAYOUT", "IMAGE_STRUCTURE"), "COG");
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path()))
    EXPECT_EQ(entry.path().filename(), "dtm.tif") << "something was left beside the file";
}

TEST_F(GeoFilesTest, ARasterWithoutCellsIsNotWritten) {
  EXPECT_THROW(write_geotiff(folder_ / "dtm.tif", {}, ""), std::exception);
  EXPECT_TRUE(std::filesystem::is_empty(folder_.path()));
}

// EPSG:3067 names north first; files of GIS have east first.
TEST_F(GeoFilesTest, TreesLieEastThenNorth) {
  Tree tree;
  tree.id = 3;
  tree.x = 400'001.5;
  tree.y = 7'000'002.25;
  tree.z = 98.125;
  write_trees_gpkg(folder_ / "trees.gpkg", {tree}, "EPSG:3067");
  const auto dataset = open("trees.gpkg", GDAL_OF_VECTOR);
  ASSERT_NE(dataset, nullptr);
  OGRLayer* layer = dataset->GetLayerByName("trees");
  ASSERT_NE(layer, nullptr);
  ASSERT_NE(layer->GetSpatialRef(), nullptr);
  EXPECT_STREQ(layer->GetSpatialRef()->GetAuthorityCode(nullptr), "3067");
  const OGRFeatureUniquePtr feature(layer->GetNextFeature());
  const OGRPoint* point = feature->GetGeometryRef()->toPoint();
  EXPECT_DOUBLE_EQ(point->getX(), tree.x);
  EXPECT_DOUBLE_EQ(point->getY(), tree.y);
  EXPECT_DOUBLE_EQ(point->getZ(), tree.z);
}

// Every column of trees.csv but the place, with its type, its whole precision, and null where it is
// not known.
TEST_F(GeoFilesTest, TreesHaveAllColumns) {
  Tree known;
  double next = 0.123456789;
  for (const TreeColumn& column : kTreeColumns) {
    if (const auto* member = std::get_if<double Tree::*>(&column.member))
      known.*(*member) = next += 1.0;
  }
  known.id = 11;
  known.observations = 4321;
  known.species = "pine";
  known.quality = "good";
  Tree unknown;
  unknown.id = 12;
  write_trees_gpkg(folder_ / "trees.gpkg", {known, unknown}, "");
  const auto dataset = open("trees.gpkg", GDAL_OF_VECTOR);
  OGRLayer* layer = dataset->GetLayerByName("trees");
  ASSERT_NE(layer, nullptr);
  EXPECT_EQ(dataset->GetLayerCount(), 1);  // no path was given
  // Undefined Cartesian, which QGIS takes for metres; srs_id 0 would be undefined degrees.
  OGRLayer* contents = dataset->ExecuteSQL("SELECT srs_id FROM gpkg_contents", nullptr, nullptr);
  ASSERT_NE(contents, nullptr);
  EXPECT_EQ(OGRFeatureUniquePtr(contents->GetNextFeature())->GetFieldAsInteger(0), -1);
  dataset->ReleaseResultSet(contents);
  EXPECT_EQ(layer->GetFeatureCount(), 2);
  const OGRFeatureUniquePtr first(layer->GetNextFeature());
  const OGRFeatureUniquePtr second(layer->GetNextFeature());
  int columns = 0;
  for (const TreeColumn& column : kTreeColumns) {
    const int field = layer->GetLayerDefn()->GetFieldIndex(column.name);
    if (column.place) {
      EXPECT_EQ(field, -1) << column.name;
      continue;
    }
    ASSERT_GE(field, 0) << column.name;
    ++columns;
    if (const auto* whole = std::get_if<int Tree::*>(&column.member)) {
      EXPECT_EQ(first->GetFieldAsInteger(field), known.*(*whole)) << column.name;
      continue;
    }
    EXPECT_FALSE(second->IsFieldSetAndNotNull(field)) << column.name;
    if (const auto* text = std::get_if<std::string Tree::*>(&column.member)) {
      EXPECT_EQ(first->GetFieldAsString(field), known.*(*text)) << column.name;
      continue;
    }
    const double value = known.*std::get<double Tree::*>(column.member);
    EXPECT_DOUBLE_EQ(first->GetFieldAsDouble(field), value) << column.name;
  }
  EXPECT_EQ(layer->GetLayerDefn()->GetFieldCount(), columns);
}

TEST_F(GeoFilesTest, AnEmptyListOfTreesIsALayerWithoutFeatures) {
  write_trees_gpkg(folder_ / "trees.gpkg", {}, "EPSG:3067");
  const auto dataset = open("trees.gpkg", GDAL_OF_VECTOR);
  ASSERT_NE(dataset, nullptr);
  OGRLayer* layer = dataset->GetLayerByName("trees");
  ASSERT_NE(layer, nullptr);
  EXPECT_EQ(layer->GetFeatureCount(), 0);
  EXPECT_EQ(layer->GetLayerDefn()->GetFieldIndex("dbh_m"), 1);
}

TEST_F(GeoFilesTest, AFolderThatIsNotThereIsAnErrorOfTheOutput) {
  EXPECT_THROW(write_geotiff(folder_ / "missing" / "dtm.tif", two_by_three(), ""), OutputError);
  EXPECT_THROW(write_trees_gpkg(folder_ / "missing" / "trees.gpkg", {Tree{}}, ""), OutputError);
}

TEST_F(GeoFilesTest, AFullDiskLeavesNoRaster) {
  ASSERT_TRUE(std::filesystem::exists("/dev/full"));
  Raster large = two_by_three();
  large.columns = large.rows = 600;
  large.values.resize(360'000);
  for (std::size_t i = 0; i < large.values.size(); ++i)
    large.values[i] = static_cast<float>(std::sin(static_cast<double>(i * i)));
  std::filesystem::create_symlink("/dev/full", part_path(folder_ / "dtm.tif"));
  EXPECT_THROW(write_geotiff(folder_ / "dtm.tif", large, ""), OutputError);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "dtm.tif"));
}

}  // namespace
}  // namespace understory
