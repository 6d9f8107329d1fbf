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

}  // namespace understory
