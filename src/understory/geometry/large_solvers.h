#pragma once

#include <Eigen/Cholesky>

namespace understory {

// Solvers of larger symmetric matrices, as fits of a calibration or of a receiver's noise need
// them. Eigen's templates are compiled for them once, and not in every file.

// Eigenvalues, ascending, and the unit eigenvectors that belong to them, one a column.
struct SymmetricEigen7 {
  Eigen::Matrix<double, 7, 1> values;
  Eigen::Matrix<double, 7, 7> vectors;
};

// Of a symmetric, finite matrix, by QR steps. Only the lower triangle is read.
[[nodiscard]] SymmetricEigen7 symmetric_eigen(const Eigen::Matrix<double, 7, 7>& matrix);

// Solves A x = b for one symmetric matrix A of any size (LDLT with pivoting).
class LargeSymmetricSolver {
 public:
  // All of `matrix` is finite; only its lower triangle is read.
  explicit LargeSymmetricSolver(const Eigen::MatrixXd& matrix);

  // `right` has as many rows as the matrix.
  [[nodiscard]] Eigen::VectorXd solve(const Eigen::VectorXd& right) const;
  [[nodiscard]] Eigen::MatrixXd inverse() const;
  // The middle of the factors: all above 0 where the matrix is positive definite.
  [[nodiscard]] Eigen::VectorXd diagonal() const;

 private:
  Eigen::LDLT<Eigen::MatrixXd> factor_;
};

}  // namespace understory
