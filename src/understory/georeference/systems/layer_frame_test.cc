#include "understory/georeference/systems/layer_frame.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include "understory/georeference/systems/coordinate_system.h"
#include "understory/georeference/systems/moved_raster.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using Eigen::Vector3d;

const GeodeticPlace kEvo{61.2, 24.7, 150.0};

Pose turned(double yaw) {
  return Pose(so3_exp(Vector3d(0.0, 0.0, yaw)) * so3_exp(Vector3d(0.01, -0.02, 0.0)),
              Vector3d(40.0, -25.0, 3.0));
}

// The transverse Mercator projection by Krüger's series, on GRS 80, without PROJ: the values of
// EPSG:3067.
Vector3d by_krueger(const GeodeticPlace& place, double central_deg) {
  constexpr double kDegree = std::numbers::pi / 180.0;
  constexpr double f = 1.0 / 298.257222101;
  const double n = f / (2.0 - f);
  const double e = std::sqrt(f * (2.0 - f));
  const double mean = 6378137.0 / (1.0 + n) * (1.0 + n * n / 4.0 + std::pow(n, 4.0) / 64.0);
  const std::array<double, 3> a = {n / 2.0 - 2.0 * n * n / 3.0 + 5.0 * n * n * n / 16.0,
                                   13.0 * n * n / 48.0 - 3.0 * n * n * n / 5.0,
                                   61.0 * n * n * n / 240.0};
  const double phi = place.latitude_deg * kDegree;
  const double lambda = (place.longitude_deg - central_deg) * kDegree;
  const double s = std::sin(phi);
  const double t = std::sinh(std::atanh(s) - e * std::atanh(e * s));
  const double xi = std::atan2(t, std::cos(lambda));
  const double eta = std::atanh(std::sin(lambda) / std::sqrt(1.0 + t * t));
  double x = eta;
  double y = xi;
  for (int j = 1; j <= 3; ++j) {
    const double c = a[static_cast<std::size_t>(j - 1)];
    x += c * std::cos(2.0 * j * xi) * std::sinh(2.0 * j * eta);
    y += c * std::sin(2.0 * j * xi) * std::cosh(2.0 * j * eta);
  }
  return {500'000.0 + 0.9996 * mean * x, 0.9996 * mean * y, place.height_m};
}

TEST(LayerFrame, PointsGoThroughTheFullTransform) {
  const Pose enu_from_world = turned(0.7);
  const LayerFrame frame(enu_from_world, kEvo, "EPSG:3067");
  const EastNorthUp enu(kEvo);
  for (const Vector3d& point :
       {Vector3d(0, 0, 0), Vector3d(1500, -900, 40), Vector3d(-8000, 12000, -60)}) {
    const Vector3d expected = by_krueger(enu.to_place(enu_from_world * point), 27.0);
    EXPECT_LT((frame.from_world(point) - expected).norm(), 5e-4) << point.transpose();
  }
  // A shift alone would be off by this much: the grid is turned and scaled.
  EXPECT_NEAR(frame.north_deg(), (27.0 - 24.7) * std::sin(61.2 * std::numbers::pi / 180.0), 0.02);
  EXPECT_NEAR(frame.scale(), 0.9996 * (1.0 + std::pow(123.6e3 / 6.39e6, 2.0) / 2.0), 3e-5);
  EXPECT_EQ(frame.code(), "EPSG:3067");
  EXPECT_EQ(frame.heights(), "above the ellipsoid");
  EXPECT_EQ(frame.offset(), Vector3d(376'000, 6'787'000, 0));
}

// Error of the interpolation in metres over 20 km and 500 m of height, and of the way back.
void expect_near_exact(const GeodeticPlace& origin, const std::string& system, double metres) {
  const LayerFrame frame(turned(2.0), origin, system);
  double forth = 0.0;
  double back = 0.0;
  for (int k = 0; k < 3000; ++k) {
    const Vector3d point(10'000.0 * std::sin(1.7 * k + 0.3), 10'000.0 * std::sin(2.9 * k),
                         250.0 * std::sin(0.61 * k));
    const Vector3d exact = frame.exact_from_world(point);
    const Vector3d found = frame.from_world(point);
    forth = std::max({forth, (found - exact).head<2>().norm() / frame.units_per_metre(),
                      std::abs(found.z() - exact.z())});
    back = std::max(back, (frame.to_world(exact) - point).norm());
  }
  EXPECT_LT(forth, metres) << system;
  EXPECT_LT(back, 1.5 * metres + 1e-4) << system;
}

TEST(LayerFrame, InterpolatedPointsLieWhereThoseOfPROJLie) {
  expect_near_exact(kEvo, "EPSG:3067", 1e-4);
  expect_near_exact(kEvo, "EPSG:4326", 1e-4);
  expect_near_exact(kEvo, "EPSG:3857", 1e-4);
  expect_near_exact(kEvo, "EPSG:2393", 1e-4);  // another datum: Finland's older system
  expect_near_exact({75.0, 20.0, 10.0}, "EPSG:32633", 1e-4);
  expect_near_exact({32.9, -97.0, 200.0}, "EPSG:2276", 4e-4);  // feet
  expect_near_exact(kEvo, "EPSG:3067+5773", 4e-4);  // a geoid, bilinear between its nodes
}

TEST(LayerFrame, AGeoidWithoutItsGridIsLeftOut) {
  const LayerFrame frame(Pose(), kEvo, "EPSG:3067+3855");
  const bool installed = !frame.lacks_geoid();
  EXPECT_EQ(frame.code(), installed ? "EPSG:3067+3855" : "EPSG:3067");
  EXPECT_EQ(frame.wkt().find("EGM2008") != std::string::npos, installed);
  EXPECT_EQ(frame.heights().find("geoid") != std::string::npos, installed);
  EXPECT_EQ(std::abs(frame.from_world(Vector3d::Zero()).z() - 150.0) > 1.0, installed);
}

TEST(LayerFrame, WithoutAPlaceItIsLocal) {
  const LayerFrame world;
  EXPECT_TRUE(world.is_world());
  EXPECT_EQ(world.from_world(Vector3d(1, 2, 3)), Vector3d(1, 2, 3));
  EXPECT_TRUE(world.wkt().empty());
  const LayerFrame moved(turned(0.3));
  EXPECT_FALSE(moved.is_world());
  EXPECT_LT((moved.to_world(turned(0.3) * Vector3d(1, 2, 3)) - Vector3d(1, 2, 3)).norm(), 1e-9);
  EXPECT_TRUE(LayerFrame(Pose()).is_world());
}

TEST(LayerFrame, RefusesWhatIsNoSystem) {
  EXPECT_THROW(LayerFrame(Pose(), kEvo, "EPSG:1"), ConfigError);
  EXPECT_THROW(LayerFrame(Pose(), kEvo, "metres"), ConfigError);
  EXPECT_TRUE(CoordinateSystem("EPSG:3067").is_made_for(kEvo));
  EXPECT_FALSE(CoordinateSystem("EPSG:3067").is_made_for({10.0, -60.0, 0.0}));
  EXPECT_FALSE(CoordinateSystem("EPSG:3067+5773").is_made_for({10.0, -60.0, 0.0}));
}

TEST(MovedRaster, LiesInTheGridOfTheSystem) {
  const LayerFrame frame(turned(0.9), kEvo, "EPSG:3067");
  const auto hill = [](double x, double y) { return 2.0 * std::sin(0.1 * x) + 0.1 * y; };
  Raster own;
  own.x0 = -20.0;
  own.y0 = -10.0;
  own.cell_m = 0.5;
  own.columns = 80;
  own.rows = 40;
  for (int row = 0; row < own.rows; ++row) {
    for (int column = 0; column < own.columns; ++column)
      own.values.push_back(static_cast<float>(
          hill(own.x0 + (column + 0.5) * own.cell_m, own.y0 + (row + 0.5) * own.cell_m)));
  }
  const FrameChange change{[&](const Vector3d& p) { return frame.from_world(p); },
                           [&](const Vector3d& p) { return frame.to_world(p); },
                           frame.units_per_metre()};
  const Raster ground = moved_raster(own, own, change, CellHeights::kOfGround);
  EXPECT_DOUBLE_EQ(std::remainder(ground.x0, 0.5), 0.0);
  int compared = 0;
  for (double x = -17.0; x < 17.0; x += 1.7) {
    for (double y = -8.0; y < 8.0; y += 1.3) {
      const Vector3d at = frame.exact_from_world({x, y, hill(x, y)});
      EXPECT_NEAR(ground.interpolate(at.x(), at.y()), at.z(), 0.02) << x << " " << y;
      ++compared;
    }
  }
  EXPECT_GT(compared, 200);
}

}  // namespace
}  // namespace understory
