#include "understory/georeference/plot_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

class PlotFile : public ::testing::Test {
 protected:
  std::string write(const std::string& name, const std::string& text) {
    const std::filesystem::path path = folder_ / name;
    std::ofstream(path) << text;
    return path.string();
  }
  void expect_refused(const std::string& file, const std::string& words,
                      const std::string& system = "") {
    try {
      (void)read_plots(file, system);
      FAIL() << "took " << file;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
    }
  }
  // GeoJSON of one feature; its coordinates are longitudes and latitudes.
  std::string json(const std::string& geometry, const std::string& properties = "{}") {
    return write("plots.geojson",
                 R"({"type":"FeatureCollection","features":[{"type":"Feature","properties":)" +
                     properties + R"(,"geometry":)" + geometry + "}]}");
  }

  test::TemporaryFolder folder_;
};

TEST_F(PlotFile, ACircleIsThreeNumbers) {
  EXPECT_TRUE(is_plot_text("1.5,-2, 9"));
  EXPECT_FALSE(is_plot_text("1.5,-2"));
  EXPECT_FALSE(is_plot_text("plots.gpkg"));
  const auto plots = read_plots("500.5, -20,9.77", "EPSG:3067");
  ASSERT_EQ(plots.size(), 1U);
  EXPECT_EQ(plots[0].id, "1");
  EXPECT_EQ(plots[0].centre, Eigen::Vector2d(500.5, -20.0));
  EXPECT_EQ(plots[0].radius_m, 9.77);
  expect_refused("1,2,0", "expected a radius_m over 0");
  expect_refused("1,nan,5", "expected a centre");
  expect_refused("1,2,inf", "expected a radius_m over 0");
}

TEST_F(PlotFile, ATableOfCircles) {
  const auto plots = read_plots(write("p.csv", "id,x,y,radius_m\nA1,1,2,9\n,3,4,5.64\n"), "");
  ASSERT_EQ(plots.size(), 2U);
  EXPECT_EQ(plots[0].id, "A1");
  EXPECT_EQ(plots[1].id, "2");
  EXPECT_EQ(plots[1].radius_m, 5.64);
  expect_refused(write("a.csv", "id,x,y\nA,1,2\n"), "radius_m");
  expect_refused(write("b.csv", "id,x,y,radius_m\n"), "it holds none");
  expect_refused(write("c.csv", "id,x,y,radius_m\nA,1,2,-3\n"), "line 2");
  expect_refused(write("d.csv", "id,x,y,radius_m\nA,1,nan,3\n"), "line 2");
  expect_refused(write("e.csv", "id,x,y,radius_m\nA,1,2,3\nA,4,5,3\n"), "every id once");
  expect_refused(write("s.csv", "id,x,y,radius_m\nseen,1,2,3\n"), "plot seen: expected another id");
  expect_refused((folder_ / "none.csv").string(), "no such file");
  expect_refused(write("f.gpkg", "no database"), "expected sample plots");
}

TEST_F(PlotFile, ItsSystemIsBroughtToThatOfTheCloud) {
  // Of 62 N, 27 E, the middle of the zone: x is 500 km there.
  const std::string file =
      json(R"({"type":"Point","coordinates":[27.0,62.0]})", R"({"id":"P7","radius_m":9.0})");
  const auto plots = read_plots(file, "EPSG:3067");
  ASSERT_EQ(plots.size(), 1U);
  EXPECT_EQ(plots[0].id, "P7");
  EXPECT_NEAR(plots[0].centre.x(), 500'000.0, 0.01);
  // Arc of the meridian by Simpson's rule on the ellipsoid, times the scale 0.9996.
  const double e2 = 0.00669438002290;
  const auto curvature = [&](double phi) {
    return 6'378'137.0 * (1.0 - e2) / std::pow(1.0 - e2 * std::pow(std::sin(phi), 2), 1.5);
  };
  const int steps = 2'000;
  const double step = 62.0 * M_PI / 180.0 / steps;
  double arc = 0.0;
  for (int i = 0; i < steps; ++i)
    arc += step / 6.0 *
           (curvature(i * step) + 4.0 * curvature((i + 0.5) * step) + curvature((i + 1) * step));
  EXPECT_NEAR(plots[0].centre.y(), 0.9996 * arc, 0.01);
  expect_refused(file, "names no coordinate system", "");
}

TEST_F(PlotFile, PolygonsHaveHolesAndAnArea) {
  const auto plots = read_plots(
      json(R"({"type":"Polygon","coordinates":[[[27.0,62.0],[27.0,62.001],[27.001,62.001],
               [27.001,62.0],[27.0,62.0]],[[27.0004,62.0004],[27.0006,62.0004],
               [27.0006,62.0006],[27.0004,62.0006],[27.0004,62.0004]]]})"),
      "EPSG:3067");
  ASSERT_EQ(plots.size(), 1U);
  ASSERT_EQ(plots[0].rings.size(), 2U);
  EXPECT_EQ(plots[0].rings[0].size(), 4U);
  EXPECT_GT(signed_area_m2(plots[0].rings[0]), 0.0);
  EXPECT_NEAR(signed_area_m2(plots[0].rings[1]) / signed_area_m2(plots[0].rings[0]), -0.04, 1e-3);
  expect_refused(json(R"({"type":"LineString","coordinates":[[27,62],[27.1,62]]})"),
                 "expected a polygon or a point", "EPSG:3067");
  expect_refused(json(R"({"type":"Point","coordinates":[27.0,62.0]})"), "radius_m", "EPSG:3067");
  expect_refused(
      json(R"({"type":"Polygon","coordinates":[[[27,62],[27.001,62],[27,62],[27,62]]]})"),
      "with an area", "EPSG:3067");
}

TEST_F(PlotFile, OutlinesThatCrossThemselvesOrOverlapAreRefused) {
  expect_refused(json(R"({"type":"Polygon","coordinates":[[[27.0,62.0],[27.002,62.0],
               [27.0,62.001],[27.001,62.002],[27.0,62.0]]]})"),
                 "does not cross itself", "EPSG:3067");
  expect_refused(json(R"({"type":"MultiPolygon","coordinates":[
               [[[27.0,62.0],[27.002,62.0],[27.002,62.001],[27.0,62.001],[27.0,62.0]]],
               [[[27.001,62.0],[27.003,62.0],[27.003,62.001],[27.001,62.001],[27.001,62.0]]]]})"),
                 "parts that do not overlap", "EPSG:3067");
}

}  // namespace
}  // namespace understory
