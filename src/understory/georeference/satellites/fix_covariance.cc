#include "understory/georeference/satellites/fix_covariance.h"

#include <algorithm>
#include <cmath>

#include "understory/geometry/symmetric_eigen.h"

namespace understory {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

bool is_covariance(const Matrix3d& c) {
  if (!c.allFinite() || c.diagonal().minCoeff() <= 0.0) return false;
  return symmetric_eigenvalues(c).minCoeff() >= -1e-9 * c.diagonal().maxCoeff();
}

}  // namespace

Matrix3d fix_covariance(const GnssFix& fix, const FixCovarianceConfig& config) {
  const double least = config.least_sd_m * config.least_sd_m;
  if (is_covariance(fix.covariance)) return fix.covariance + least * Matrix3d::Identity();
  Vector3d sd(config.default_plane_sd_m, config.default_plane_sd_m, config.default_height_sd_m);
  if (std::isfinite(fix.hdop) && fix.hdop > 0.0) {
    sd.x() = sd.y() = fix.hdop * config.sd_per_dop_m / std::sqrt(2.0);
    sd.z() = std::max(sd.z(), 2.0 * sd.x());
  }
  if (std::isfinite(fix.vdop) && fix.vdop > 0.0) sd.z() = fix.vdop * config.sd_per_dop_m;
  return sd.cwiseAbs2().asDiagonal().toDenseMatrix() + least * Matrix3d::Identity();
}

}  // namespace understory
