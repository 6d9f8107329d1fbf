#include "understory/geometry/symmetric_eigen.h"

#include <Eigen/Eigenvalues>

namespace understory {

SymmetricEigen2 symmetric_eigen(const Eigen::Matrix2d& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(matrix);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

}  // namespace understory
