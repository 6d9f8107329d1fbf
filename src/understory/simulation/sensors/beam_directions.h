#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "understory/simulation/sensors/lidar_model.h"

namespace understory {

// Directions of the beams of one firing at azimuth 0 of the head, and level ones to the left of
// each. Unit vectors in the lidar's frame.
struct BeamDirections {
  BeamDirections() = default;
  // `time_ns`: of the firing, since the first revolution. `higher_rad`: by which all look higher.
  BeamDirections(const LidarModel& model, double time_ns, double higher_rad = 0.0);
  [[nodiscard]] Eigen::Vector3d direction(std::size_t beam) const {
    return {x[beam], y[beam], z[beam]};
  }
  std::vector<double> x, y, z;
  std::vector<float> near_x, near_y, near_z, near_side_x, near_side_y;  // for casting
};

// A rotation about the sensor's axis.
struct HeadTurn {
  explicit HeadTurn(double angle_rad);
  Eigen::Vector3d operator*(const Eigen::Vector3d& v) const {
    return {cosine * v.x() - sine * v.y(), sine * v.x() + cosine * v.y(), v.z()};
  }
  [[nodiscard]] Eigen::Matrix3d matrix() const;
  double cosine;
  double sine;
};

}  // namespace understory
