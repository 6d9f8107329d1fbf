#pragma once

#include <Eigen/Core>
#include <vector>

namespace understory {

// Points in single precision, metres, relative to an origin near them (body or local frame).
using Points = std::vector<Eigen::Vector3f>;

}  // namespace understory
