#include "understory/output/clouds/las_writer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "understory/recording/clouds/cloud_file.h"
#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"
#include "understory/util/log.h"

namespace understory {
namespace {

// What our own reader makes of a written cloud.
class LasWriterTest : public ::testing::Test {
 protected:
  PointCloudFile written(const std::string& name, const std::vector<LasRecord>& points,
                         const LasOptions& options = {}) {
    LasWriter writer(folder_ / name, options);
    for (const LasRecord& point : points)
      writer.add(point);
    EXPECT_FALSE(std::filesystem::exists(folder_ / name)) << "before commit";
    writer.commit();
    EXPECT_EQ(writer.points(), points.size());
    Log log;
    PointCloudFile cloud = read_cloud(folder_ / name, log);
    EXPECT_TRUE(log.warnings().empty());
    return cloud;
  }
  static Eigen::Vector3d place(const PointCloudFile& cloud, std::size_t i) {
    return cloud.origin + cloud.points[i].cast<double>();
  }
  test::TemporaryFolder folder_;
};

constexpr TimeNs kIn2023 = 1'700'000'000 * kNsPerSecond;

TEST_F(LasWriterTest, PlaceAndClassComeBackOnTheRightAxes) {
  const PointCloudFile cloud =
      written("map.laz", {{12.3456, -7.0004, 101.2, kIn2023, 513, 2}, {-1.0, 2.0, 3.0, 0, 7, 5}});
  ASSERT_EQ(cloud.points.size(), 2U);
  EXPECT_LT((place(cloud, 0) - Eigen::Vector3d(12.346, -7.0, 101.2)).cwiseAbs().maxCoeff(), 2e-5);
  EXPECT_LT((place(cloud, 1) - Eigen::Vector3d(-1.0, 2.0, 3.0)).cwiseAbs().maxCoeff(), 2e-5);
  EXPECT_EQ(cloud.classification, (std::vector<std::uint8_t>{2, 5}));
  EXPECT_EQ(cloud.intensity, (std::vector<float>{513.0F, 7.0F}));
}

// Coordinates of a map projection keep the millimetre: 7,000,123.457 m is no float.
TEST_F(LasWriterTest, FarFromTheOriginTheMillimetreStays) {
  LasOptions options;
  options.offset = {400'000.0, 7'000'000.0, 0.0};
  const PointCloudFile cloud = written("map.laz", {{400'012.345, 7'000'123.457, 88.001}}, options);
  EXPECT_LT(
      (place(cloud, 0) - Eigen::Vector3d(400'012.345, 7'000'123.457, 88.001)).cwiseAbs().maxCoeff(),
      2e-5);
}

TEST_F(LasWriterTest, TheCoordinateSystemComesBack) {
  LasOptions options;
  options.crs_wkt =
      "PROJCS[\"ETRS89 / TM35FIN(E,N)\",GEOGCS[\"ETRS89\",DATUM[\"European_Terrestrial_Reference_"
      "System_1989\",SPHEROID[\"GRS 1980\",6378137,298.257222101]],PRIMEM[\"Greenwich\",0],UNIT["
      "\"degree\",0.0174532925199433]],PROJECTION[\"Transverse_Mercator\"],UNIT[\"metre\",1]]";
  EXPECT_EQ(written("map.laz", {{}}, options).coordinate_system, options.crs_wkt);
  EXPECT_EQ(written("local.laz", {{}}).coordinate_system, "");
}

TEST_F(LasWriterTest, TheEndingOfTheNameDecidesOnCompression) {
  const std::vector<LasRecord> points(1000, {1.0, 2.0, 3.0});
  const PointCloudFile laz = written("map.laz", points);
  const PointCloudFile las = written("map.las", points);
  EXPECT_EQ(laz.points, las.points);
  EXPECT_LT(std::filesystem::file_size(folder_ / "map.laz"),
            std::filesystem::file_size(folder_ / "map.las") / 4);
}

// The day at the turn of 2016 to 2017 had a leap second: GPS time ran ahead by 17 s, then by 18 s.
TEST_F(LasWriterTest, GpsTimeKnowsLeapSeconds) {
  constexpr TimeNs kNewYear = 1'483'228'800 * kNsPerSecond;
  const PointCloudFile cloud = written("map.laz", {{0, 0, 0, kNewYear - kNsPerSecond},
                                                   {0, 0, 0, kNewYear},
                                                   {0, 0, 0, 42 * kNsPerSecond + 500'000'000}});
  ASSERT_EQ(cloud.gps_time.size(), 3U);
  EXPECT_NEAR(cloud.gps_time[1] - cloud.gps_time[0], 2.0, 1e-6);
  // Adjusted standard time: GPS seconds since 6 January 1980, less a billion.
  EXPECT_NEAR(cloud.gps_time[1], 1'483'228'800.0 - 315'964'800.0 + 18.0 - 1e9, 1e-6);
  EXPECT_NEAR(cloud.gps_time[2], 42.5, 1e-9) << "a stamp of no calendar stays as it is";
}

TEST_F(LasWriterTest, APlaceThatIsNoNumberIsRefused) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinite = std::numeric_limits<double>::infinity();
  LasWriter writer(folder_ / "map.laz", {});
  EXPECT_THROW(writer.add({nan, 0.0, 0.0}), OutputError);
  EXPECT_THROW(writer.add({0.0, infinite, 0.0}), OutputError);
  EXPECT_THROW(writer.add({0.0, 0.0, -infinite}), OutputError);
  EXPECT_EQ(writer.points(), 0U);
}

TEST_F(LasWriterTest, AFileWithoutPointsIsWhole) {
  LasWriter writer(folder_ / "map.laz", {});
  writer.commit();
  EXPECT_GE(std::filesystem::file_size(folder_ / "map.laz"), 375U);
}

TEST_F(LasWriterTest, WhatIsNotCommittedLeavesNothing) {
  {
    LasWriter writer(folder_ / "map.laz", {});
    writer.add({});
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder_.path()));
  EXPECT_THROW(LasWriter(folder_ / "missing" / "map.laz", {}), OutputError);
}

}  // namespace
}  // namespace understory
