#pragma once

#include <Eigen/Core>
#include <vector>

#include "understory/geometry/pose.h"

namespace understory {

// The numbers of a matrix, row by row, for JSON.
[[nodiscard]] std::vector<double> numbers_of(const Eigen::MatrixXd& matrix);

// "a_from_b" on stdout and below it the motion's 4 x 4 matrix, a line a row.
void print_motion(const Pose& a_from_b);

}  // namespace understory
