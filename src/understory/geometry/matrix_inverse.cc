#include "understory/geometry/matrix_inverse.h"

#include <Eigen/LU>

namespace understory {

Eigen::Matrix<double, 6, 6> inverse_matrix(const Eigen::Matrix<double, 6, 6>& matrix) {
  return matrix.inverse();
}

}  // namespace understory
