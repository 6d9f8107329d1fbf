#include "understory/geometry/matrix_inverse.h"

#include <gtest/gtest.h>

#include <cmath>

namespace understory {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

// Neither symmetric nor with a large diagonal: the rows have to be exchanged.
Matrix6 with_zero_diagonal() {
  Matrix6 matrix;
  for (int i = 0; i < 6; ++i) {
    for (int k = 0; k < 6; ++k)
      matrix(i, k) = i == k ? 0.0 : std::sin(1.0 + 3.0 * i + 7.0 * k);
  }
  return matrix;
}

TEST(MatrixInverse, TimesTheMatrixIsTheIdentity) {
  const Matrix6 matrix = with_zero_diagonal();
  EXPECT_LT((matrix * inverse_matrix(matrix) - Matrix6::Identity()).norm(), 1e-12);
  EXPECT_LT((inverse_matrix(matrix) * matrix - Matrix6::Identity()).norm(), 1e-12);
}

TEST(MatrixInverse, OfASingularMatrixIsNotFinite) {
  Matrix6 matrix = with_zero_diagonal();
  matrix.row(4).setZero();
  EXPECT_FALSE(inverse_matrix(matrix).allFinite());
}

}  // namespace
}  // namespace understory
