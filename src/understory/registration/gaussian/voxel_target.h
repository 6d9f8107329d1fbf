#pragma once

#include <Eigen/Core>
#include <cmath>
#include <memory>
#include <utility>

#include "understory/registration/gaussian/gaussian_match.h"
#include "understory/registration/gaussian/gaussian_voxels.h"

namespace understory::internal {

// Rows R with e^T W^-1 e = |R e|^2, from the Cholesky factor of W (positive definite).
[[nodiscard]] inline Eigen::Matrix3d whitening(const Eigen::Matrix3d& covariance) {
  const Eigen::Matrix3d& w = covariance;
  // L L^T = W; the rows are L^-1. Written out: this is done for every pair at every step.
  const double a = 1.0 / std::sqrt(w(0, 0));
  const double l10 = w(1, 0) * a;
  const double l20 = w(2, 0) * a;
  const double b = 1.0 / std::sqrt(w(1, 1) - l10 * l10);
  const double l21 = (w(2, 1) - l20 * l10) * b;
  const double c = 1.0 / std::sqrt(w(2, 2) - l20 * l20 - l21 * l21);
  Eigen::Matrix3d rows;
  rows << a, 0.0, 0.0, -a * l10 * b, b, 0.0, (l10 * l21 * b - l20) * a * c, -l21 * b * c, c;
  return rows;
}

// What VGICP and NDT from distribution to distribution share. A mean of the source meets the
// Gaussian of its voxel, in the metric of the sum of both covariances. `Method` derives from this
// and adds source_of() and kExactGradient, see gaussian_match.h.
class VoxelTarget {
 public:
  struct Known {};  // nothing of a search helps the next

  // `added_m2`: added to the sum of both covariances; `noise_m2`: see GaussianAccumulator.
  VoxelTarget(GaussianVoxelsPtr voxels, double added_m2, double noise_m2, bool faces)
      : voxels_(std::move(voxels)), added_m2_(added_m2), noise_m2_(noise_m2), faces_(faces) {}
  [[nodiscard]] std::size_t size() const { return voxels_->size(); }
  [[nodiscard]] bool pair(const GaussianSource& source, std::size_t i, const Eigen::Vector3d& at,
                          const Eigen::Matrix3d& rotation, Known& /*known*/,
                          GaussianPair& pair) const {
    const GaussianVoxel* voxel = voxels_->find(at, faces_, pair.offset);
    if (voxel == nullptr) return false;
    pair.tells = voxel->tells;
    if (!pair.tells) return true;
    const Eigen::Matrix3d own = source.covariances[i].cast<double>();
    pair.rows = whitening(voxel->covariance.cast<double>() + rotation * own * rotation.transpose() +
                          added_m2_ * Eigen::Matrix3d::Identity());
    return true;
  }
  // A point is at most some two edges from the mean of its voxel or of one beside it.
  [[nodiscard]] double most_squared() const {
    return 4.0 * voxels_->voxel_m() * voxels_->voxel_m() / noise_m2_;
  }
  [[nodiscard]] double noise_m2() const { return noise_m2_; }

 protected:
  [[nodiscard]] double voxel_m() const { return voxels_->voxel_m(); }

 private:
  GaussianVoxelsPtr voxels_;
  double added_m2_;
  double noise_m2_;
  bool faces_;
};

}  // namespace understory::internal
