#pragma once

#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/registration/global/match_verdict.h"

namespace understory {

// The numbers of a matrix, row by row, for JSON.
[[nodiscard]] std::vector<double> numbers_of(const Eigen::MatrixXd& matrix);

// "a_from_b" on stdout and below it the motion's 4 x 4 matrix, a line a row.
void print_motion(const Pose& a_from_b);

// The verdict on a match as an object of numbers and words, and as lines of text on stdout.
[[nodiscard]] nlohmann::ordered_json verdict_json(const MatchVerdict& verdict);
void print_verdict(const MatchVerdict& verdict);

}  // namespace understory
