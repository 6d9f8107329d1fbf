#include "understory/pipeline/correction/moved_map.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "understory/georeference/terrain_file.h"
#include "understory/output/geo_files.h"
#include "understory/output/las_writer.h"
#include "understory/recording/bags/byte_source.h"
#include "understory/recording/clouds/las.h"

namespace understory {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kAnywhere = 1e7;

// The writer turns Unix time into adjusted standard GPS time, and leaves seconds as they are; here
// is the way back.
TimeNs stamp_of(double gps_time) {
  constexpr double kAdjusted = 1e9;
  constexpr double kUnixAtGpsEpoch = 315'964'800.0;
  constexpr double kLeapSeconds = 18.0;
  const bool seconds = gps_time >= 0.0 && gps_time < 1e7;
  return from_seconds(seconds ? gps_time : gps_time + kAdjusted + kUnixAtGpsEpoch - kLeapSeconds);
}

void move_cloud(const fs::path& from, const fs::path& to, const Pose& motion, Log& log) {
  const auto file = open_file(from.string());
  const LasHeader header = read_las_header(*file);
  LasOptions options;
  const Vector3d middle = motion * Vector3d(0.5 * (header.low + header.high));
  if (middle.head<2>().norm() > 1e5) options.offset = (middle / 1000.0).array().round() * 1000.0;
  LasWriter writer(to, options);
  read_las_points(*file, header, log, [&](const LasPoint& point) {
    LasRecord record;
    const Vector3d at = motion * point.position;
    record.x = at.x();
    record.y = at.y();
    record.z = at.z();
    record.stamp = stamp_of(point.gps_time);
    record.intensity =
        static_cast<std::uint16_t>(std::clamp(std::lround(point.intensity), 0L, 65535L));
    record.classification = point.classification;
    writer.add(record);
  });
  writer.commit();
}

// Ground, or heights above it, which a motion leaves as they are.
enum class Heights { kOfGround, kAboveGround };

Raster empty_under(const Raster& own, const Raster& ground, const Pose& motion) {
  Vector2d low = Vector2d::Constant(std::numeric_limits<double>::max());
  Vector2d high = -low;
  for (const double x : {own.x0, own.x0 + own.columns * own.cell_m}) {
    for (const double y : {own.y0, own.y0 + own.rows * own.cell_m}) {
      const Vector2d at = (motion * Vector3d(x, y, ground.z0)).head<2>();
      low = low.cwiseMin(at);
      high = high.cwiseMax(at);
    }
  }
  Raster raster;
  raster.cell_m = own.cell_m;
  raster.x0 = std::floor(low.x() / own.cell_m) * own.cell_m;
  raster.y0 = std::floor(low.y() / own.cell_m) * own.cell_m;
  raster.columns = static_cast<int>(std::ceil((high.x() - raster.x0) / own.cell_m));
  raster.rows = static_cast<int>(std::ceil((high.y() - raster.y0) / own.cell_m));
  raster.values.assign(
      static_cast<std::size_t>(raster.columns) * static_cast<std::size_t>(raster.rows),
      std::numeric_limits<float>::quiet_NaN());
  return raster;
}

// `ground` says how high the cells lie: a tilt moves what is high aside.
Raster moved_raster(const Raster& own, const Raster& ground, const Pose& motion, Heights heights) {
  Raster raster = empty_under(own, ground, motion);
  const Pose back = motion.inverse();
  const double height_of_all = (motion * Vector3d(own.x0, own.y0, ground.z0)).z();
  raster.z0 = heights == Heights::kOfGround ? std::floor(height_of_all) : own.z0;
  for (int row = 0; row < raster.rows; ++row) {
    for (int column = 0; column < raster.columns; ++column) {
      const double x = raster.x0 + (column + 0.5) * raster.cell_m;
      const double y = raster.y0 + (row + 0.5) * raster.cell_m;
      double z = height_of_all;
      Vector3d at = Vector3d::Zero();
      for (int round = 0; round < 4; ++round) {
        at = back * Vector3d(x, y, z);
        const double here = ground.interpolate(at.x(), at.y());
        if (std::isfinite(here)) z += here - at.z();
      }
      const double value = own.interpolate(at.x(), at.y());
      if (!std::isfinite(value)) continue;
      raster.values[raster.index(column, row)] =
          static_cast<float>((heights == Heights::kOfGround ? z : value) - raster.z0);
    }
  }
  return raster;
}

}  // namespace

void write_moved_map(const fs::path& run, const fs::path& result, const Pose& target_from_world,
                     Log& log) {
  if (fs::exists(run / "map.laz"))
    move_cloud(run / "map.laz", result / "map.laz", target_from_world, log);
  if (!fs::exists(run / "dtm.tif")) return;
  const PlaneArea all{Vector2d::Constant(-kAnywhere), Vector2d::Constant(kAnywhere)};
  const Raster ground = read_terrain(run / "dtm.tif", all, std::nullopt);
  write_geotiff(result / "dtm.tif",
                moved_raster(ground, ground, target_from_world, Heights::kOfGround), "");
  if (!fs::exists(run / "chm.tif")) return;
  const Raster canopy = read_terrain(run / "chm.tif", all, std::nullopt);
  write_geotiff(result / "chm.tif",
                moved_raster(canopy, ground, target_from_world, Heights::kAboveGround), "");
}

}  // namespace understory
