#pragma once

#include "understory/geometry/plane/plane_grid.h"
#include "understory/geometry/pose.h"

namespace understory {

// Covariance of a matched pose (right perturbation, rotation first) that may be tilted by `sd_rad`
// about each of its source's level axes (z up). The points stay on those that they were matched to.
// So the pose turns about their middle, not about its own origin some metres above them, and a tilt
// moves the origin.
[[nodiscard]] inline Matrix6d tilt_about(const Eigen::Vector3d& middle_in_source, double sd_rad) {
  Eigen::Matrix<double, 6, 2> turn = Eigen::Matrix<double, 6, 2>::Zero();
  turn.topRows<2>().setIdentity();
  turn.bottomRows<3>() = skew(middle_in_source).leftCols<2>();
  return sd_rad * sd_rad * turn * turn.transpose();
}

// Mean of points; zero for none.
[[nodiscard]] inline Eigen::Vector3d middle_of(const SparsePoints& points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points)
    sum += point;
  return points.empty() ? sum : Eigen::Vector3d(sum / static_cast<double>(points.size()));
}

}  // namespace understory
