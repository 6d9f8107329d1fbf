#pragma once

#include "understory/geometry/pose.h"

namespace understory::test {

// For tests: the covariance of a pose of such standard deviations, rad and m, about each axis.
inline Matrix6d covariance(double rotation, double translation) {
  Matrix6d c = Matrix6d::Zero();
  c.diagonal() << Eigen::Vector3d::Constant(rotation * rotation),
      Eigen::Vector3d::Constant(translation * translation);
  return c;
}

}  // namespace understory::test
