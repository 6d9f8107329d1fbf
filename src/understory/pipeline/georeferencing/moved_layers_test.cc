#include "understory/pipeline/georeferencing/moved_layers.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

#include "understory/georeference/terrain_file.h"
#include "understory/output/clouds/las_writer.h"
#include "understory/output/layers/geo_files.h"
#include "understory/recording/bags/byte_source.h"
#include "understory/recording/clouds/las.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

double hill(double x, double y) {
  return 2.0 * std::sin(0.1 * x) + 0.1 * y;
}

// Heights above the ground: taller towards the east.
double trees(double x) {
  return 10.0 + 0.2 * x;
}

Raster layer_raster(bool ground) {
  Raster raster;
  raster.x0 = -20.0;
  raster.y0 = -10.0;
  raster.cell_m = 0.5;
  raster.columns = 80;
  raster.rows = 40;
  for (int row = 0; row < raster.rows; ++row) {
    for (int column = 0; column < raster.columns; ++column) {
      const double x = raster.x0 + (column + 0.5) * raster.cell_m;
      const double y = raster.y0 + (row + 0.5) * raster.cell_m;
      raster.values.push_back(static_cast<float>(ground ? hill(x, y) : trees(x)));
    }
  }
  return raster;
}

struct Folders {
  test::TemporaryFolder both;
  fs::path run = both / "run";
  fs::path result = both / "result";
  Folders() {
    fs::create_directory(run);
    fs::create_directory(result);
  }
};

TEST(MovedLayers, CloudAndRastersGoWithThePath) {
  const Folders folders;
  constexpr std::int64_t kUnix = 1'780'000'000'250'000'000;
  {
    LasWriter writer(folders.run / "map.laz", LasOptions{});
    for (int k = 0; k < 1000; ++k) {
      const double x = -20.0 + 0.04 * k;
      writer.add({x, 3.0, hill(x, 3.0), k < 500 ? kUnix : TimeNs{2'430'500'000'000},
                  static_cast<std::uint16_t>(k), static_cast<std::uint8_t>(k % 2 == 0 ? 2 : 5)});
    }
    writer.commit();
  }
  write_geotiff(folders.run / "dtm.tif", layer_raster(true), "");
  write_geotiff(folders.run / "chm.tif", layer_raster(false), "");

  const Pose motion(so3_exp(Vector3d(0.0, 0.0, 1.1)) * so3_exp(Vector3d(0.05, -0.03, 0.0)),
                    Vector3d(300.0, -200.0, 120.0));
  Log log;
  const LayerFrame local;
  MapPicture picture;
  write_moved_layers({folders.run, local}, motion, {folders.result, local}, local, picture, log);
  EXPECT_FALSE(picture.empty());

  const auto before = open_file((folders.run / "map.laz").string());
  const auto after = open_file((folders.result / "map.laz").string());
  std::vector<LasPoint> points[2];
  int which = 0;
  for (ByteSource* file : {before.get(), after.get()}) {
    read_las_points(*file, read_las_header(*file), log,
                    [&](const LasPoint& point) { points[which].push_back(point); });
    ++which;
  }
  ASSERT_EQ(points[0].size(), 1000U);
  ASSERT_EQ(points[1].size(), 1000U);
  for (std::size_t k = 0; k < 1000; k += 7) {
    EXPECT_LT((motion * points[0][k].position - points[1][k].position).norm(), 0.0011);
    EXPECT_EQ(points[0][k].intensity, points[1][k].intensity);
    EXPECT_EQ(points[0][k].classification, points[1][k].classification);
    EXPECT_NEAR(points[0][k].gps_time, points[1][k].gps_time, 1e-6);
  }

  const PlaneArea area{motion.translation().head<2>().array() - 100.0,
                       motion.translation().head<2>().array() + 100.0};
  const Raster ground = read_terrain(folders.result / "dtm.tif", area, std::nullopt);
  const Raster canopy = read_terrain(folders.result / "chm.tif", area, std::nullopt);
  int compared = 0;
  for (double x = -17.0; x < 17.0; x += 1.7) {
    for (double y = -8.0; y < 8.0; y += 1.3) {
      const Vector3d at = motion * Vector3d(x, y, hill(x, y));
      EXPECT_NEAR(ground.interpolate(at.x(), at.y()), at.z(), 0.02) << x << " " << y;
      EXPECT_NEAR(canopy.interpolate(at.x(), at.y()), trees(x), 0.02) << x << " " << y;
      ++compared;
    }
  }
  EXPECT_GT(compared, 200);
  // Nothing is known beyond the edges.
  const Vector3d beyond = motion * Vector3d(0.0, 14.0, 0.0);
  EXPECT_TRUE(std::isnan(ground.cell_value(beyond.x(), beyond.y())));
}

void write_points_of_trees(const fs::path& path) {
  LasOptions options;
  options.trees = true;
  LasWriter writer(path, options);
  for (std::uint32_t k = 0; k < 3000; ++k) {
    LasRecord record;
    record.x = 0.01 * k;
    record.tree_id = k % 7;
    record.height_above_ground =
        k % 5 == 0 ? std::numeric_limits<float>::quiet_NaN() : 0.1F * static_cast<float>(k);
    writer.add(record);
  }
  writer.commit();
}

void expect_points_of_trees(const fs::path& path) {
  Log log;
  const auto file = open_file(path.string());
  const LasHeader header = read_las_header(*file);
  ASSERT_TRUE(header.has_trees);
  std::uint32_t k = 0;
  read_las_points(*file, header, log, [&](const LasPoint& point) {
    EXPECT_EQ(point.tree_id, k % 7);
    if (k % 5 == 0) {
      EXPECT_TRUE(std::isnan(point.height_above_ground));
    } else {
      EXPECT_EQ(point.height_above_ground, 0.1F * static_cast<float>(k));
    }
    ++k;
  });
  EXPECT_EQ(k, 3000U);
}

// A regression: the points of a full inventory lost the tree that they belong to.
TEST(MovedLayers, PointsKeepTheirTreesAndHeights) {
  const Folders folders;
  write_points_of_trees(folders.run / "map.laz");
  Log log;
  const LayerFrame local;
  MapPicture picture;
  write_moved_layers({folders.run, local}, Pose(), {folders.result, local}, local, picture, log);
  expect_points_of_trees(folders.result / "map.laz");
  write_points_of_trees(folders.run / "plain.las");
  expect_points_of_trees(folders.run / "plain.las");
}

// A run on the globe is read back from its own system, whatever that is.
TEST(MovedLayers, FromOneCoordinateSystemIntoAnother) {
  const Folders folders;
  const GeodeticPlace place{61.2, 24.7, 150.0};
  const Pose enu_from_world(so3_exp(Vector3d(0.0, 0.0, 0.6)), Vector3d(5.0, 6.0, 7.0));
  const LayerFrame before(enu_from_world, place, "EPSG:3067");
  const LayerFrame after(Pose(), place, "EPSG:32634");
  const std::vector<Vector3d> points = {{0, 0, 0}, {40, -30, 5}, {-25, 60, 12}};
  {
    LasOptions options;
    options.offset = before.offset();
    options.crs_wkt = before.wkt();
    LasWriter writer(folders.run / "map.laz", options);
    for (const Vector3d& point : points) {
      const Vector3d at = before.exact_from_world(point);
      writer.add({at.x(), at.y(), at.z(), 1, 2, 2});
    }
    writer.commit();
  }
  Log log;
  MapPicture picture;
  write_moved_layers({folders.run, before}, enu_from_world, {folders.result, after}, after, picture,
                     log);
  const auto file = open_file((folders.result / "map.laz").string());
  const LasHeader header = read_las_header(*file);
  EXPECT_EQ(header.coordinate_system, after.wkt());
  std::size_t next = 0;
  read_las_points(*file, header, log, [&](const LasPoint& point) {
    const Vector3d expected = after.exact_from_world(enu_from_world * points[next++]);
    EXPECT_LT((point.position - expected).norm(), 0.002);
  });
  EXPECT_EQ(next, points.size());
}

}  // namespace
}  // namespace understory
