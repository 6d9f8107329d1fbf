#include "understory/geometry/best_rotation.h"

#include <Eigen/LU>
#include <Eigen/SVD>

namespace understory {

BestRotation best_rotation(const Eigen::Matrix3d& products) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(products, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs = Eigen::Vector3d::Ones();
  if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0) signs.z() = -1.0;
  return {svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose(), svd.singularValues()};
}

}  // namespace understory
