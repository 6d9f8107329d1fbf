#include "understory/georeference/systems/moved_raster.h"

#include <cmath>
#include <limits>

namespace understory {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Cells of the target over all of the source, without values.
Raster empty_over(const Raster& own, const Raster& ground, const FrameChange& change) {
  Vector2d low = Vector2d::Constant(std::numeric_limits<double>::max());
  Vector2d high = -low;
  for (const double x : {own.x0, own.x0 + own.columns * own.cell_m}) {
    for (const double y : {own.y0, own.y0 + own.rows * own.cell_m}) {
      const Vector2d at = change.to_target(Vector3d(x, y, ground.z0)).head<2>();
      low = low.cwiseMin(at);
      high = high.cwiseMax(at);
    }
  }
  Raster raster;
  raster.cell_m = own.cell_m * change.cell_ratio;
  raster.x0 = std::floor(low.x() / raster.cell_m) * raster.cell_m;
  raster.y0 = std::floor(low.y() / raster.cell_m) * raster.cell_m;
  raster.columns = static_cast<int>(std::ceil((high.x() - raster.x0) / raster.cell_m));
  raster.rows = static_cast<int>(std::ceil((high.y() - raster.y0) / raster.cell_m));
  raster.values.assign(
      static_cast<std::size_t>(raster.columns) * static_cast<std::size_t>(raster.rows),
      std::numeric_limits<float>::quiet_NaN());
  return raster;
}

}  // namespace

Raster moved_raster(const Raster& own, const Raster& ground, const FrameChange& change,
                    CellHeights heights) {
  if (change.none) return own;
  constexpr int kRounds = 4;  // height and place of a cell tell each other
  constexpr double kNearM = 1e-4;
  Raster raster = empty_over(own, ground, change);
  const double level = change.to_target(Vector3d(own.x0, own.y0, ground.z0)).z();
  raster.z0 = heights == CellHeights::kOfGround ? std::floor(level) : own.z0;
  for (int row = 0; row < raster.rows; ++row) {
    double z = level;
    for (int column = 0; column < raster.columns; ++column) {
      const double x = raster.x0 + (column + 0.5) * raster.cell_m;
      const double y = raster.y0 + (row + 0.5) * raster.cell_m;
      if (!std::isfinite(z)) z = level;
      Vector3d at = Vector3d::Zero();
      for (int round = 0; round < kRounds; ++round) {
        at = change.to_source(Vector3d(x, y, z));
        const double here = ground.interpolate(at.x(), at.y());
        if (!std::isfinite(here) || std::abs(here - at.z()) < kNearM) break;
        z = change.to_target(Vector3d(at.x(), at.y(), here)).z();
      }
      const double value = own.interpolate(at.x(), at.y());
      if (!std::isfinite(value)) continue;
      raster.values[raster.index(column, row)] =
          static_cast<float>((heights == CellHeights::kOfGround ? z : value) - raster.z0);
    }
  }
  return raster;
}

}  // namespace understory
