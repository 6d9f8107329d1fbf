#include "understory/geometry/large_solvers.h"

#include <gtest/gtest.h>

#include <random>

namespace understory {
namespace {

// Symmetric, with eigenvalues of both signs.
Eigen::MatrixXd drawn_matrix(Eigen::Index size) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> number(-1.0, 1.0);
  Eigen::MatrixXd matrix(size, size);
  for (Eigen::Index i = 0; i < size; ++i)
    for (Eigen::Index j = 0; j <= i; ++j)
      matrix(i, j) = matrix(j, i) = number(random);
  return matrix;
}

TEST(LargeSolvers, AxesAndValuesGiveTheMatrixAgain) {
  const Eigen::Matrix<double, 7, 7> matrix = drawn_matrix(7);
  const SymmetricEigen7 axes = symmetric_eigen(matrix);
  EXPECT_LT((axes.vectors * axes.values.asDiagonal() * axes.vectors.transpose() - matrix).norm(),
            1e-12);
  EXPECT_LT((axes.vectors.transpose() * axes.vectors - Eigen::MatrixXd::Identity(7, 7)).norm(),
            1e-12);
  for (Eigen::Index k = 1; k < 7; ++k)
    EXPECT_LE(axes.values[k - 1], axes.values[k]);
}

TEST(LargeSolvers, WhatIsSolvedFitsTheMatrix) {
  const Eigen::MatrixXd root = drawn_matrix(12);
  const Eigen::MatrixXd matrix = root * root.transpose() + Eigen::MatrixXd::Identity(12, 12);
  const LargeSymmetricSolver solver(matrix);
  const Eigen::VectorXd right = drawn_matrix(12).col(3);
  EXPECT_LT((matrix * solver.solve(right) - right).norm(), 1e-12);
  EXPECT_LT((matrix * solver.inverse() - Eigen::MatrixXd::Identity(12, 12)).norm(), 1e-11);
  EXPECT_GT(solver.diagonal().minCoeff(), 0.0);
  EXPECT_LT(LargeSymmetricSolver(-matrix).diagonal().maxCoeff(), 0.0);
}

}  // namespace
}  // namespace understory
