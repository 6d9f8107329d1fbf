#include "understory/geometry/rotation_between.h"

#include <cmath>

namespace understory {
namespace {

// Closer to opposite than this (1 plus the cosine), the cross product is too short for an axis.
constexpr double kOpposite = 1e-12;

}  // namespace

// Eigen's FromTwoVectors, with the same digits, but for opposite directions. There it decomposes a
// matrix, which took nine seconds to compile.
Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d start = from.normalized();
  const Eigen::Vector3d end = to.normalized();
  const double cosine = end.dot(start);
  if (cosine < kOpposite - 1.0) {
    // Half a turn about any axis across, then the little that is left.
    const Eigen::Vector3d across = start.unitOrthogonal();
    return rotation_between(-start, end) *
           Eigen::Quaterniond(0.0, across.x(), across.y(), across.z());
  }
  const Eigen::Vector3d axis = start.cross(end);
  const double s = std::sqrt((1.0 + cosine) * 2.0);
  const double inverse = 1.0 / s;
  Eigen::Quaterniond rotation;
  rotation.vec() = axis * inverse;
  rotation.w() = s * 0.5;
  return rotation;
}

}  // namespace understory
