#include "understory/registration/icp/surface.h"

#include <Eigen/Eigenvalues>
#include <cmath>

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
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(covariance.cast<double>());
  const Eigen::Vector3d& variance = solver.eigenvalues();
  // A line that is not steep is what a ring of the lidar left on the ground: it says nothing.
  if (variance[1] < kLineRatio * variance[2]) {
    const Eigen::Vector3d axis = solver.eigenvectors().col(2);
    if (std::abs(axis.z()) < kPoleCosine) return {};
    return {SurfaceKind::kPole, axis.cast<float>()};
  }
  if (variance[0] < max_planarity * variance[1])
    return {SurfaceKind::kPlane, solver.eigenvectors().col(0).cast<float>()};
  return {};
}

}  // namespace understory
