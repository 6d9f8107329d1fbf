#include "understory/georeference/trees/tree_map_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

std::filesystem::path write(const test::TemporaryFolder& folder, const std::string& name,
                            const std::string& text) {
  std::ofstream(folder.path() / name) << text;
  return folder.path() / name;
}

TEST(TreeMapFile, ReadsTreesCsvOfARun) {
  const test::TemporaryFolder folder;
  const TreeMapFile map = read_tree_map(
      write(folder, "trees.csv",
            "id,x,y,z,dbh_m,dbh_sd_m,height_m\n7,1.5,2.5,100.25,0.31,0.01,\n8,3,4,,,,18.5\n"),
      "EPSG:3067");
  ASSERT_EQ(map.trees.size(), 2U);
  EXPECT_EQ(map.coordinate_system, "EPSG:3067");
  EXPECT_EQ(map.trees[0].x, 1.5);
  EXPECT_EQ(map.trees[0].z, 100.25);
  EXPECT_EQ(map.trees[0].dbh_m, 0.31);
  EXPECT_TRUE(std::isnan(map.trees[0].height_m));
  EXPECT_TRUE(std::isnan(map.trees[1].z));
  EXPECT_EQ(map.trees[1].height_m, 18.5);
}

TEST(TreeMapFile, ReadsTablesOfSurveyors) {
  const test::TemporaryFolder folder;
  const TreeMapFile map = read_tree_map(
      write(folder, "plot.csv", "Northing,Easting,DBH,H\n6581642.5,974353.25,37.6,23.6\n"), "");
  ASSERT_EQ(map.trees.size(), 1U);
  EXPECT_EQ(map.trees[0].x, 974353.25);
  EXPECT_EQ(map.trees[0].y, 6581642.5);
  EXPECT_NEAR(map.trees[0].dbh_m, 0.376, 1e-12);
  EXPECT_EQ(map.trees[0].height_m, 23.6);
  EXPECT_TRUE(std::isnan(map.trees[0].z));
  ASSERT_EQ(map.remarks.size(), 1U);
  EXPECT_NE(map.remarks[0].find("centimetres"), std::string::npos);
}

TEST(TreeMapFile, ReadsPointsByGdal) {
  const test::TemporaryFolder folder;
  const TreeMapFile map =
      read_tree_map(write(folder, "trees.geojson",
                          R"({"type":"FeatureCollection","name":"trees","features":[
{"type":"Feature","properties":{"Height":21.5,"dbh_cm":30},
 "geometry":{"type":"Point","coordinates":[25.5,61.25]}}]})"),
                    "");
  ASSERT_EQ(map.trees.size(), 1U);
  EXPECT_EQ(map.trees[0].y, 61.25);
  EXPECT_EQ(map.trees[0].height_m, 21.5);
  EXPECT_NEAR(map.trees[0].dbh_m, 0.3, 1e-12);
  EXPECT_TRUE(std::isnan(map.trees[0].z));
  EXPECT_NE(map.coordinate_system.find("WGS 84"), std::string::npos);
}

TEST(TreeMapFile, NamesWhatIsWrong) {
  const test::TemporaryFolder folder;
  EXPECT_THROW((void)read_tree_map(folder.path() / "none.csv", ""), InputError);
  EXPECT_THROW((void)read_tree_map(write(folder, "a.csv", "x,y\n"), ""), InputError);
  EXPECT_THROW((void)read_tree_map(write(folder, "b.csv", "id,size\n1,2\n"), ""), InputError);
  EXPECT_THROW((void)read_tree_map(write(folder, "c.csv", "x,y\n1,\n"), ""), InputError);
  EXPECT_THROW((void)read_tree_map(write(folder, "d.gpkg", "no database"), ""), InputError);
}

TEST(TreeMapFile, DiametersInMillimetresAndThoseOfNoUnitAreTold) {
  const test::TemporaryFolder folder;
  const auto file = folder.path() / "trees.csv";
  const auto read = [&](const std::string& text) {
    std::ofstream(file) << text;
    return read_tree_map(file, "");
  };
  const TreeMapFile millimetres = read("x,y,dbh\n1,2,310\n3,4,290\n5,6,330\n");
  EXPECT_NEAR(millimetres.trees[0].dbh_m, 0.31, 1e-12);
  ASSERT_EQ(millimetres.remarks.size(), 1U);
  EXPECT_NE(millimetres.remarks[0].find("millimetres"), std::string::npos);
  for (const char* text : {"x,y,dbh_m\n1,2,31\n", "x,y,dbh_cm\n1,2,0.31\n"}) {
    const TreeMapFile wrong = read(text);
    ASSERT_EQ(wrong.remarks.size(), 1U) << text;
    EXPECT_NE(wrong.remarks[0].find("its unit is another one"), std::string::npos);
  }
  EXPECT_TRUE(read("x,y,dbh_cm\n1,2,31\n").remarks.empty());
  EXPECT_TRUE(read("x,y,dbh_m\n1,2,\n").remarks.empty());
}

}  // namespace
}  // namespace understory
