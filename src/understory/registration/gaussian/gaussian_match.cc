#include "understory/registration/gaussian/gaussian_match.h"

#include <algorithm>

#include "understory/geometry/symmetric_eigen.h"

namespace understory {

void describe(ConfigTable& table, GaussianStepsConfig& config) {
  table.add("sigma_m", config.sigma_m, {0.001, 1.0}, "m",
            "noise of a point, added to every covariance");
  table.add("kernel_sigmas", config.kernel_sigmas, {0.1, 100.0}, "",
            "scale of the kernel: matches much farther apart hardly count");
  describe(table, config.loss);
  internal::describe_steps(table, config);
}

Eigen::Matrix3d three_planes(const Eigen::Matrix3d& covariance) {
  const SymmetricEigen3 eigen = fast_symmetric_eigen(covariance);
  // What rounding leaves of the values of a thin covariance.
  const double least = 1e-7 * eigen.values[2];
  const Eigen::Vector3d scale = eigen.values.cwiseMax(least).cwiseSqrt().cwiseInverse();
  return scale.asDiagonal() * eigen.vectors.transpose();
}

}  // namespace understory
