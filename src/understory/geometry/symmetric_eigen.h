#pragma once

#include <Eigen/Core>

namespace understory {

// Eigenvalues, ascending, and the unit eigenvectors that belong to them, one a column.
struct SymmetricEigen2 {
  Eigen::Vector2d values;
  Eigen::Matrix2d vectors;
};

// Of a symmetric, finite matrix, such as the scatter of points in the plane. Only the lower
// triangle is read.
[[nodiscard]] SymmetricEigen2 symmetric_eigen(const Eigen::Matrix2d& matrix);

// The same of a 3 x 3 matrix.
struct SymmetricEigen3 {
  Eigen::Vector3d values;
  Eigen::Matrix3d vectors;
};

// Of a symmetric, finite matrix, by its characteristic polynomial. It is several times as fast as
// QR steps, with values that are off by some 1e-8 of the largest. For the scatter of points in
// space.
[[nodiscard]] SymmetricEigen3 fast_symmetric_eigen(const Eigen::Matrix3d& matrix);

// The same by QR steps: to the last digits.
[[nodiscard]] SymmetricEigen3 symmetric_eigen(const Eigen::Matrix3d& matrix);

// The eigenvalues alone, ascending, by QR steps: to the last digits.
[[nodiscard]] Eigen::Vector3d symmetric_eigenvalues(const Eigen::Matrix3d& matrix);

}  // namespace understory
