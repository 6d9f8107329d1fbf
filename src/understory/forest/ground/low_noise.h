#pragma once

#include <Eigen/Core>
#include <optional>

#include "understory/forest/point_blocks.h"
#include "understory/geometry/raster.h"

namespace understory {

// Tells points below the ground: ghosts of other pulses, echoes that took a longer way. Where a
// cloud is dense there are some in every square metre, so that the lowest points say nothing of the
// ground. But they are spread over tens of metres of depth, and ground is a layer. In squares of 2
// m the lowest layer of 1 m that holds a few points, and 0.4 % of all there, is taken for real.
class LowNoise {
 public:
  // Runs through the cloud once. Heights are counted from `level_m`, or from the first point.
  explicit LowNoise(const PointBlocks& cloud, std::optional<double> level_m = std::nullopt);
  // Whether a point (world frame, metres) lies more than half a metre below the lowest real layer.
  [[nodiscard]] bool holds(const Eigen::Vector3d& point) const;

 private:
  Raster lowest_;  // height of that layer; NaN where nothing is known
};

}  // namespace understory
