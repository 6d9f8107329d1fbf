#pragma once

#include <Eigen/Core>

namespace understory {

// The inverse of a 6 x 6 matrix, such as the information of a pose from its covariance. LU with
// partial pivoting: the matrix need not be symmetric. Not finite where the matrix is singular.
// Eigen's templates are compiled for it once, and not in every file.
[[nodiscard]] Eigen::Matrix<double, 6, 6> inverse_matrix(const Eigen::Matrix<double, 6, 6>& matrix);

}  // namespace understory
