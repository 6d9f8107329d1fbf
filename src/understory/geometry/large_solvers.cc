#include "understory/geometry/large_solvers.h"

#include <Eigen/Eigenvalues>

namespace understory {

SymmetricEigen7 symmetric_eigen(const Eigen::Matrix<double, 7, 7>& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 7, 7>> solver(matrix);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

LargeSymmetricSolver::LargeSymmetricSolver(const Eigen::MatrixXd& matrix) : factor_(matrix) {}

Eigen::VectorXd LargeSymmetricSolver::solve(const Eigen::VectorXd& right) const {
  return factor_.solve(right);
}

Eigen::MatrixXd LargeSymmetricSolver::inverse() const {
  return factor_.solve(Eigen::MatrixXd::Identity(factor_.rows(), factor_.rows()));
}

Eigen::VectorXd LargeSymmetricSolver::diagonal() const {
  return factor_.vectorD();
}

}  // namespace understory
