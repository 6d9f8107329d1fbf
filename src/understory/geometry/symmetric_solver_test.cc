#include "understory/geometry/symmetric_solver.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/geometry/symmetric_eigen.h"

namespace understory {
namespace {

// Positive definite, with eigenvalues of very different sizes.
template <int N>
Eigen::Matrix<double, N, N> positive_definite() {
  Eigen::Matrix<double, N, N> root;
  for (int i = 0; i < N; ++i) {
    for (int k = 0; k < N; ++k)
      root(i, k) = std::sin(1.0 + 3.0 * i + 7.0 * k) * std::pow(10.0, -i);
  }
  return root * root.transpose() + 1e-9 * Eigen::Matrix<double, N, N>::Identity();
}

template <int N>
void solves() {
  const auto matrix = positive_definite<N>();
  const SymmetricSolver<N> solver(matrix);
  EXPECT_TRUE(solver.is_positive());
  const Eigen::Matrix<double, N, 1> right = Eigen::Matrix<double, N, 1>::LinSpaced(1.0, 2.0);
  EXPECT_LT((matrix * solver.solve(right) - right).norm(), 1e-5) << N;
  EXPECT_LT((matrix * solver.inverse() - Eigen::Matrix<double, N, N>::Identity()).norm(), 1e-5);
}

TEST(SymmetricSolver, SolvesForThreeFourAndSixUnknowns) {
  solves<3>();
  solves<4>();
  solves<6>();
}

TEST(SymmetricSolver, KnowsADirectionThatIsOpen) {
  Eigen::Matrix3d open = Eigen::Matrix3d::Identity();
  open(2, 2) = 0.0;
  EXPECT_FALSE(SymmetricSolver<3>(open).is_positive());
  open(2, 2) = -1.0;
  EXPECT_FALSE(SymmetricSolver<3>(open).is_positive());
}

TEST(SymmetricEigen, BothWaysGiveTheAxesOfAScatter) {
  const Eigen::Matrix3d matrix = positive_definite<3>();
  const Eigen::Vector3d exact = symmetric_eigenvalues(matrix);
  const SymmetricEigen3 fast = fast_symmetric_eigen(matrix);
  EXPECT_LE(exact(0), exact(1));
  EXPECT_LE(exact(1), exact(2));
  EXPECT_LT((fast.values - exact).norm(), 1e-7 * exact(2));
  const Eigen::Matrix3d again = fast.vectors * fast.values.asDiagonal() * fast.vectors.transpose();
  EXPECT_LT((again - matrix).norm(), 1e-7 * exact(2));
}

}  // namespace
}  // namespace understory
