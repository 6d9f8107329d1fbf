#pragma once

#include <Eigen/Geometry>

namespace understory {

// The smallest rotation that turns the direction of `from` into that of `to`; neither is zero. Both
// may have any length. For opposite directions one of the possible axes is taken.
[[nodiscard]] Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from,
                                                  const Eigen::Vector3d& to);

}  // namespace understory
