#include "understory/registration/icp/surface.h"

#include <cmath>

#include "understory/geometry/symmetric_eigen.h"
#include "understory/registration/registration_constants.h"

namespace understory {
namespace {

using namespace registration_constants::surface;

}  // namespace

SurfacePatch surface_of(const SurfaceSums& sums, double max_planarity) {
  if (sums.count < kFewestPoints) return {};
  const auto count = static_cast<float>(sums.count);
  const Eigen::Matrix3f covariance =
      sums.products / count - sums.sum * sums.sum.transpose() / (count * count);
  const SymmetricEigen3 eigen = fast_symmetric_eigen(covariance.cast<double>());
  const Eigen::Vector3d& variance = eigen.values;
  // A line that is not steep is what a ring of the lidar left on the ground: it says nothing.
  if (variance[1] < kLineRatio * variance[2]) {
    const Eigen::Vector3d axis = eigen.vectors.col(2);
    if (std::abs(axis.z()) < kPoleCosine) return {};
    return {SurfaceKind::kPole, axis.cast<float>()};
  }
  if (variance[0] < max_planarity * variance[1])
    return {SurfaceKind::kPlane, eigen.vectors.col(0).cast<float>()};
  return {};
}

}  // namespace understory
