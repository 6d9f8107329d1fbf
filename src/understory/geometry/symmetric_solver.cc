#include "understory/geometry/symmetric_solver.h"

namespace understory {

template <int N>
SymmetricSolver<N>::SymmetricSolver(const Matrix& matrix) : factor_(matrix) {}

template <int N>
bool SymmetricSolver<N>::is_positive() const {
  return factor_.info() == Eigen::Success && factor_.vectorD().minCoeff() > 0.0;
}

template <int N>
typename SymmetricSolver<N>::Vector SymmetricSolver<N>::solve(const Vector& right) const {
  return factor_.solve(right);
}

template <int N>
typename SymmetricSolver<N>::Matrix SymmetricSolver<N>::inverse() const {
  return factor_.solve(Matrix::Identity());
}

template class SymmetricSolver<3>;
template class SymmetricSolver<4>;
template class SymmetricSolver<6>;

}  // namespace understory
