#include "understory/georeference/terrain_fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>

#include "understory/georeference/systems/coordinate_system.h"
#include "understory/georeference/terrain_file.h"
#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

using Eigen::Vector3d;

double hills(double x, double y) {
  return 4.0 * std::sin(x / 25.0) + 3.0 * std::cos(y / 18.0) + 0.03 * x + 120.0;
}

Raster raster_of(double relief) {
  Raster raster;
  raster.x0 = -100.0;
  raster.y0 = -100.0;
  raster.cell_m = 2.0;
  raster.columns = raster.rows = 150;
  raster.z0 = 120.0;
  for (int row = 0; row < raster.rows; ++row) {
    for (int column = 0; column < raster.columns; ++column) {
      const double x = raster.x0 + (column + 0.5) * raster.cell_m;
      const double y = raster.y0 + (row + 0.5) * raster.cell_m;
      raster.values.push_back(static_cast<float>(relief * (hills(x, y) - 120.0)));
    }
  }
  return raster;
}

// Feet on the terrain with 10 cm of noise, seen by a map that `world_from_terrain` has bent. Every
// tenth is hidden, so that it looks a metre too high.
std::vector<GroundPoint> feet(const Raster& terrain, const Pose& world_from_terrain) {
  std::mt19937 random(2);
  std::normal_distribution<double> noise(0.0, 0.1);
  std::uniform_real_distribution<double> along(-20.0, 130.0);
  std::uniform_real_distribution<double> across(-25.0, 25.0);
  std::vector<GroundPoint> points;
  for (int k = 0; k < 600; ++k) {
    const double x = along(random);
    const double y = across(random);
    const double z = terrain.interpolate(x, y) + noise(random) + (k % 10 == 0 ? 1.0 : 0.0);
    points.push_back({world_from_terrain * Vector3d(x, y, z), 0.1});
  }
  return points;
}

Pose bend(double yaw, const Vector3d& shift) {
  return {so3_exp({0.010, -0.015, yaw}), shift};
}

// Largest difference from the true motion over the ends of the road.
double end_error_m(const TerrainFit& fit, const Pose& world_from_terrain, bool in_space) {
  double worst = 0.0;
  for (const double x : {-20.0, 130.0}) {
    const Vector3d end(x, 0.0, hills(x, 0.0));
    const Vector3d d = fit.terrain_from_world * (world_from_terrain * end) - end;
    worst = std::max(worst, in_space ? d.norm() : std::abs(d.z()));
  }
  return worst;
}

TEST(TerrainFit, LevelsAMapThatStandsWhereItShould) {
  const Raster terrain = raster_of(1.0);
  const Pose bent = bend(0.0, {0.0, 0.0, -118.0});
  // Tilted about the origin, so places 120 m above it have moved by 1.8 m: bring them back first.
  std::vector<GroundPoint> points = feet(terrain, bent);
  const Vector3d before = bent * Vector3d(55.0, 0.0, 120.0) - Vector3d(55.0, 0.0, 2.0);
  for (GroundPoint& point : points)
    point.point_in_world.head<2>() -= before.head<2>();
  const TerrainFit fit = fit_to_terrain(points, terrain, {});
  ASSERT_TRUE(fit.found) << fit.reason;
  EXPECT_NEAR(fit.tilt_deg, std::hypot(0.010, 0.015) * 180.0 / M_PI, 0.05);
  const Pose placed = Pose(Eigen::Quaterniond::Identity(), {-before.x(), -before.y(), 0.0}) * bent;
  EXPECT_LT(end_error_m(fit, placed, false), 0.06);
  EXPECT_GT(fit.rms_before_m, 0.6);
  EXPECT_LT(fit.rms_m, 0.40);  // the hidden ones are in it
  EXPECT_LT(fit.median_m, 0.10);
  EXPECT_GT(fit.used, 500U);
  EXPECT_LT(fit.used, 560U);  // the hidden ones were not used
  EXPECT_LT(fit.place_sd_m, 1e-6);
  // Kept: place and heading.
  const Vector3d pivot = fit.terrain_from_world * points.front().point_in_world;
  EXPECT_LT((pivot - points.front().point_in_world).head<2>().norm(), 0.1);
}

TEST(TerrainFit, ReliefTellsThePlaceIfItIsAsked) {
  const Raster terrain = raster_of(1.0);
  const Pose bent = Pose(Eigen::Quaterniond::Identity(), {0.0, 0.0, 120.0}) *
                    bend(0.02, {1.5, -1.0, 3.0}) *
                    Pose(Eigen::Quaterniond::Identity(), {0.0, 0.0, -120.0});
  TerrainFitConfig config;
  config.place_sd_m = 3.0;
  config.yaw_sd_deg = 3.0;
  const TerrainFit fit = fit_to_terrain(feet(terrain, bent), terrain, config);
  ASSERT_TRUE(fit.found) << fit.reason;
  EXPECT_LT(end_error_m(fit, bent, true), 0.25);
  // Across the road a shift is nearly a tilt, so it is known worse.
  EXPECT_LT(fit.place_sd_m, 1.0);
  EXPECT_LT(fit.yaw_sd_deg, 0.5);
}

TEST(TerrainFit, FlatGroundLeavesThePlaceAlone) {
  const Raster terrain = raster_of(0.0);
  TerrainFitConfig config;
  config.place_sd_m = 3.0;
  config.yaw_sd_deg = 3.0;
  const std::vector<GroundPoint> points = feet(terrain, bend(0.0, {0.0, 0.0, 0.0}));
  const TerrainFit fit = fit_to_terrain(points, terrain, config);
  ASSERT_TRUE(fit.found);
  EXPECT_GT(fit.place_sd_m, 2.0);
  EXPECT_GT(fit.yaw_sd_deg, 1.0);
}

TEST(TerrainFit, TooFewPointsOrALineSaySo) {
  const Raster terrain = raster_of(1.0);
  std::vector<GroundPoint> line;
  for (int k = 0; k < 50; ++k)
    line.push_back({Vector3d(k, 0.0, 120.0), 0.1});
  EXPECT_FALSE(fit_to_terrain(line, terrain, {}).found);
  EXPECT_FALSE(fit_to_terrain({}, terrain, {}).found);
  std::vector<GroundPoint> outside = feet(terrain, Pose());
  for (GroundPoint& point : outside)
    point.point_in_world.x() += 1000.0;
  const TerrainFit fit = fit_to_terrain(outside, terrain, {});
  EXPECT_FALSE(fit.found);
  EXPECT_NE(fit.reason.find("0 of 600"), std::string::npos) << fit.reason;
}

TEST(EastNorthUp, ThereAndBackAndAgainstTheEllipsoid) {
  const EastNorthUp frame({63.318, 30.193, 150.0});
  const Vector3d point(800.0, -650.0, 30.0);
  EXPECT_LT((frame.from_place(frame.to_place(point)) - point).norm(), 1e-8);
  // A minute of latitude in Finland is 1857.5 m along the meridian: its radius of curvature there
  // is a (1 - e2) / (1 - e2 sin2)^1.5 = 6,386.6 km.
  const Vector3d north = frame.from_place({63.318 + 1.0 / 60.0, 30.193, 150.0});
  EXPECT_NEAR(north.y(), 6386745.0 * M_PI / 180.0 / 60.0, 1.0);
  EXPECT_NEAR(north.x(), 0.0, 1e-6);
  EXPECT_NEAR(north.z(), -north.y() * north.y() / 2.0 / 6386745.0, 1e-3);
}

class TerrainFile : public ::testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }

  const test::TemporaryFolder folder_;
};

TEST_F(TerrainFile, AnAsciiGridIsReadWhereItLies) {
  const auto path = write("dem.asc",
                          "ncols 3\nnrows 2\nxllcorner 100\nyllcorner 200\ncellsize 2\n"
                          "NODATA_value -9999\n11 12 -9999\n1 2 3\n");
  const Raster raster = read_terrain(path, {{100.0, 200.0}, {106.0, 204.0}}, std::nullopt);
  EXPECT_DOUBLE_EQ(raster.cell_value(101.0, 201.0), 1.0);
  EXPECT_DOUBLE_EQ(raster.cell_value(105.0, 201.0), 3.0);
  EXPECT_DOUBLE_EQ(raster.cell_value(103.0, 203.0), 12.0);
  EXPECT_TRUE(std::isnan(raster.cell_value(105.0, 203.0)));
  EXPECT_DOUBLE_EQ(raster.interpolate(102.0, 201.0), 1.5);
}

TEST_F(TerrainFile, OnlyThePartOverTheAreaIsRead) {
  std::string text = "ncols 200\nnrows 100\nxllcorner 0\nyllcorner 0\ncellsize 1\n";
  for (int row = 0; row < 100; ++row) {
    for (int column = 0; column < 200; ++column)
      text += std::to_string(column + 1000 * (99 - row) % 7919) + " ";
    text += "\n";
  }
  const auto path = write("dem.asc", text);
  const Raster all = read_terrain(path, {{0.0, 0.0}, {200.0, 100.0}}, std::nullopt);
  const Raster part = read_terrain(path, {{50.0, 30.0}, {60.0, 40.0}}, std::nullopt);
  EXPECT_LT(part.columns, 15);
  EXPECT_LT(part.rows, 15);
  for (double x = 50.5; x < 60.0; x += 1.0)
    EXPECT_DOUBLE_EQ(part.cell_value(x, 35.5), all.cell_value(x, 35.5));
}

TEST_F(TerrainFile, ASystemIsFollowedNotOnlyShifted) {
  // Three degrees east of the central meridian of ETRS-TM35FIN grid north lies east of true north.
  const GeodeticPlace origin{63.0, 30.0, 100.0};
  const auto at = CoordinateSystem("EPSG:3067").from_place(origin);
  ASSERT_TRUE(at.has_value());
  std::string text = "ncols 300\nnrows 300\nxllcorner " + std::to_string(at->x() - 300.0) +
                     "\nyllcorner " + std::to_string(at->y() - 300.0) + "\ncellsize 2\n";
  // A plane that rises by 10 % towards grid north.
  for (int row = 0; row < 300; ++row) {
    for (int column = 0; column < 300; ++column)
      text += std::to_string(150.0 + 0.1 * ((299.5 - row) * 2.0 - 300.0)) + " ";
    text += "\n";
  }
  const auto path = write("dem.asc", text);
  std::ofstream(folder_ / "dem.prj")
      << "PROJCS[\"TM35FIN\",GEOGCS[\"ETRS89\",DATUM[\"European_Terrestrial_Reference_System_"
         "1989\","
         "SPHEROID[\"GRS 1980\",6378137,298.257222101]],PRIMEM[\"Greenwich\",0],UNIT[\"degree\","
         "0.0174532925199433]],PROJECTION[\"Transverse_Mercator\"],PARAMETER[\"latitude_of_"
         "origin\","
         "0],PARAMETER[\"central_meridian\",27],PARAMETER[\"scale_factor\",0.9996],PARAMETER["
         "\"false_easting\",500000],PARAMETER[\"false_northing\",0],UNIT[\"metre\",1]]";
  const Raster local = read_terrain(path, {{-150.0, -150.0}, {150.0, 150.0}}, origin);
  EXPECT_NEAR(local.interpolate(0.0, 0.0), 50.0, 0.01);
  const double turn = std::atan(std::tan(3.0 * M_PI / 180.0) * std::sin(63.0 * M_PI / 180.0));
  ASSERT_GT(turn, 0.04);
  // Grid scale there: 0.9996 (1 + (east of the meridian / R)^2 / 2).
  const double scale = 0.9996 * (1.0 + std::pow((at->x() - 500000.0) / 6.385e6, 2.0) / 2.0);
  EXPECT_NEAR(local.interpolate(0.0, 100.0) - local.interpolate(0.0, -100.0),
              20.0 * scale * std::cos(turn), 0.01);
  EXPECT_NEAR(local.interpolate(100.0, 0.0) - local.interpolate(-100.0, 0.0),
              20.0 * scale * std::sin(turn), 0.01);
}

TEST_F(TerrainFile, WhatIsNoTerrainIsRefusedByName) {
  const PlaneArea area{{0.0, 0.0}, {10.0, 10.0}};
  const auto said = [&](const std::filesystem::path& path) {
    try {
      (void)read_terrain(path, area, std::nullopt);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(said(folder_ / "none.tif").find("no such file"), std::string::npos);
  EXPECT_NE(said(write("words.tif", "no raster")).find("expected a terrain model"),
            std::string::npos);
  const std::string head = "ncols 2\nnrows 2\nxllcorner 500\nyllcorner 0\ncellsize 5\n";
  EXPECT_NE(said(write("far.asc", head + "1 2\n3 4\n")).find("of the place"), std::string::npos);
  const std::string here = "ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 5\n";
  EXPECT_NE(said(write("empty.asc", here + "NODATA_value -1\n-1 -1\n-1 -1\n")).find("without data"),
            std::string::npos);
  EXPECT_NE(said(write("huge.asc", here + "1e30 2\n3 4\n")).find("in metres"), std::string::npos);
}

}  // namespace
}  // namespace understory
