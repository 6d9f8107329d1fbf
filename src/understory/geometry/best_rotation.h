#pragma once

#include <Eigen/Core>

namespace understory {

// A rotation, and how well the points tell it.
struct BestRotation {
  Eigen::Matrix3d rotation;
  Eigen::Vector3d extents;  // singular values of the products, the largest first
};

// The rotation R with the least sum of |target - R source|^2, from the products sum of
// target source^T, both about their means: Umeyama 1991, eq. 40 and 43. Where the smallest two
// extents are zero, any turn about one axis is as good.
[[nodiscard]] BestRotation best_rotation(const Eigen::Matrix3d& products);

}  // namespace understory
