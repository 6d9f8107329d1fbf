#include "understory/geometry/rotation_between.h"

namespace understory {

// Compiled here once. Eigen's function brings a singular value decomposition with it, a fifth of
// the time that a file of the odometry takes to compile.
Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  return Eigen::Quaterniond::FromTwoVectors(from, to);
}

}  // namespace understory
