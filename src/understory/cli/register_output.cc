#include "understory/cli/register_output.h"

#include <cstdio>

namespace understory {

std::vector<double> numbers_of(const Eigen::MatrixXd& matrix) {
  std::vector<double> numbers;
  numbers.reserve(static_cast<std::size_t>(matrix.size()));
  for (Eigen::Index r = 0; r < matrix.rows(); ++r) {
    for (Eigen::Index c = 0; c < matrix.cols(); ++c)
      numbers.push_back(matrix(r, c));
  }
  return numbers;
}

void print_motion(const Pose& a_from_b) {
  const Eigen::Matrix4d matrix = a_from_b.matrix();
  std::printf("a_from_b\n");
  for (int r = 0; r < 4; ++r)
    std::printf("%.9f %.9f %.9f %.9f\n", matrix(r, 0), matrix(r, 1), matrix(r, 2), matrix(r, 3));
}

}  // namespace understory
