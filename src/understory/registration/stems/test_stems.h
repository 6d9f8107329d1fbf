#pragma once

#include <random>

#include "understory/geometry/plane/plane_grid.h"
#include "understory/geometry/pose.h"

namespace understory::testing {

// A stand around the origin, and the same seen again: moved, with noise and with other stems.
struct Pair {
  SparsePoints target;
  SparsePoints source;
  Pose target_from_source;
};

inline Pair make_pair(unsigned seed, int stems, double noise_m, double lost, const Pose& truth) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> place(-25.0, 25.0);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::normal_distribution<double> noise(0.0, 1.0);
  Pair pair;
  pair.target_from_source = truth;
  for (int i = 0; i < stems; ++i) {
    const Eigen::Vector3d at(place(random), place(random), 0.03 * place(random));
    if (unit(random) > 0.5 * lost) pair.target.push_back(at);
    if (unit(random) > 0.5 * lost)
      pair.source.push_back(
          truth.inverse() *
          (at + noise_m * Eigen::Vector3d(noise(random), noise(random), noise(random))));
  }
  return pair;
}

inline Pose yaw_pose(double yaw, double x, double y, double z) {
  return Pose(Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ())), {x, y, z});
}

}  // namespace understory::testing
