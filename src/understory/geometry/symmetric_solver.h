#pragma once

#include <Eigen/Cholesky>

namespace understory {

// Solves A x = b for one symmetric N x N matrix A, such as the information of a pose (LDLT with
// pivoting). N is 3, 4 or 6: Eigen's templates are compiled for these once, and not in every file.
template <int N>
class SymmetricSolver {
 public:
  using Vector = Eigen::Matrix<double, N, 1>;
  using Matrix = Eigen::Matrix<double, N, N>;

  // All of `matrix` is finite; only its lower triangle is read.
  explicit SymmetricSolver(const Matrix& matrix);

  // Whether the matrix is positive definite, so that no direction is left open.
  [[nodiscard]] bool is_positive() const;
  [[nodiscard]] Vector solve(const Vector& right) const;
  [[nodiscard]] Matrix inverse() const;

 private:
  Eigen::LDLT<Matrix> factor_;
};

extern template class SymmetricSolver<3>;
extern template class SymmetricSolver<4>;
extern template class SymmetricSolver<6>;

}  // namespace understory
