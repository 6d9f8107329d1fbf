#include "understory/forest/obstacles.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "understory/forest/forest_constants.h"

namespace understory {

using namespace forest_constants::obstacles;

void describe(ConfigTable& table, ObstacleConfig& config) {
  table.add("enabled", config.enabled,
            "write obstacles.laz and free_height.tif: what stands in the way along the path");
  table.add("reach_m", config.reach_m, {0.5, 200.0}, "m",
            "obstacles within this distance of the path in the plane");
  table.add("least_height_m", config.least_height_m, {0.0, 50.0}, "m",
            "what is lower above the ground is no obstacle");
  table.add("cell_m", config.cell_m, {0.1, 10.0}, "m", "cell of free_height.tif");
}

ObstacleMap::ObstacleMap(const ObstacleConfig& config, std::span<const Eigen::Vector3d> path)
    : config_(config) {
  if (path.empty()) return;
  Eigen::Vector2d low = path[0].head<2>();
  Eigen::Vector2d high = low;
  for (const Eigen::Vector3d& place : path) {
    low = low.cwiseMin(place.head<2>());
    high = high.cwiseMax(place.head<2>());
  }
  const Eigen::Vector2d size = (high - low).array() + 2.0 * config_.reach_m;
  free_.cell_m = config_.cell_m;
  while (size.x() / free_.cell_m * (size.y() / free_.cell_m) > kMostCells)
    free_.cell_m *= 2.0;
  // Edges at whole cells, so that two runs of one world have the same ones.
  free_.x0 = free_.cell_m * std::floor((low.x() - config_.reach_m) / free_.cell_m);
  free_.y0 = free_.cell_m * std::floor((low.y() - config_.reach_m) / free_.cell_m);
  free_.columns = free_.column_of(high.x() + config_.reach_m) + 1;
  free_.rows = free_.row_of(high.y() + config_.reach_m) + 1;
  const std::size_t cells =
      static_cast<std::size_t>(free_.columns) * static_cast<std::size_t>(free_.rows);
  free_.values.assign(cells, std::numeric_limits<float>::quiet_NaN());
  near_.assign(cells, 0);
  Eigen::Vector2d last = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  for (const Eigen::Vector3d& place : path) {
    if ((place.head<2>() - last).norm() < 0.5 * free_.cell_m) continue;
    mark_around(place);
    last = place.head<2>();
  }
}

void ObstacleMap::mark_around(const Eigen::Vector3d& place) {
  const double square = config_.reach_m * config_.reach_m;
  for (int row = free_.row_of(place.y() - config_.reach_m);
       row <= free_.row_of(place.y() + config_.reach_m); ++row) {
    for (int column = free_.column_of(place.x() - config_.reach_m);
         column <= free_.column_of(place.x() + config_.reach_m); ++column) {
      const double dx = free_.x0 + (column + 0.5) * free_.cell_m - place.x();
      const double dy = free_.y0 + (row + 0.5) * free_.cell_m - place.y();
      if (free_.contains(column, row) && dx * dx + dy * dy <= square)
        near_[free_.index(column, row)] = 1;
    }
  }
}

bool ObstacleMap::add(const Eigen::Vector3d& point, double height_m) {
  if (free_.empty() || !(height_m >= config_.least_height_m)) return false;
  const int column = free_.column_of(point.x());
  const int row = free_.row_of(point.y());
  if (!free_.contains(column, row)) return false;
  const std::size_t cell = free_.index(column, row);
  if (near_[cell] == 0) return false;
  float& lowest = free_.values[cell];
  if (!(lowest <= static_cast<float>(height_m))) lowest = static_cast<float>(height_m);
  return true;
}

}  // namespace understory
