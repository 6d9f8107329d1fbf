#pragma once

#include <Eigen/Core>
#include <span>

#include "understory/geometry/raster.h"
#include "understory/util/config/config.h"

namespace understory {

// What stands in the way of a carrier that flies below or above the crowns.
struct ObstacleConfig {
  bool enabled = false;         // write obstacles.laz and free_height.tif
  double reach_m = 15.0;        // from the path, in the plane
  double least_height_m = 1.0;  // what is lower above the ground is no obstacle
  double cell_m = 0.5;          // of the free height
};
void describe(ConfigTable& table, ObstacleConfig& config);

// Obstacles along a path, and the free height below them. World frame, metres, z up.
class ObstacleMap {
 public:
  // `path`: places of the carrier. Where the cells of its surroundings were more than 40 million,
  // they are made wider by a power of two.
  ObstacleMap(const ObstacleConfig& config, std::span<const Eigen::Vector3d> path);

  // Takes a point of the map, `height_m` above the ground (NaN: unknown). Whether it is an
  // obstacle: near the path, and not lower than an obstacle is.
  bool add(const Eigen::Vector3d& point, double height_m);

  // The height above the ground of the lowest obstacle of each cell near the path; NaN where there
  // is none, and farther away.
  [[nodiscard]] const Raster& free_height() const { return free_; }

 private:
  void mark_around(const Eigen::Vector3d& place);

  ObstacleConfig config_;
  Raster free_;
  std::vector<char> near_;  // cells of free_ within reach
};

}  // namespace understory
