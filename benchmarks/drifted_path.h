#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "understory/evaluation/trajectory.h"
#include "understory/simulation/world.h"
#include "understory/util/random.h"

namespace understory {

// The carrier's poses on a simulated site at these times.
inline Trajectory true_path(const SimulatedWorld& world, const std::vector<TimeNs>& stamps,
                            TimeNs start) {
  Trajectory path;
  for (const TimeNs stamp : stamps)
    path.push_back({stamp, world.plan.path.pose(to_seconds(stamp - start))});
  return path;
}

// The truth as a map or an odometry would have it: in the frame of its first pose, level to 0.05
// degrees. Its errors grow with the way.
inline Trajectory drifted_path(const Trajectory& truth, std::uint64_t seed) {
  Random random(seed, 7);
  const auto normal = [&](double sd) {
    return Eigen::Vector3d(random.normal(0.0, sd), random.normal(0.0, sd), random.normal(0.0, sd));
  };
  const Pose first = truth.front().world_from_body;
  const Eigen::Vector3d heading = first.rotation() * Eigen::Vector3d::UnitX();
  const Pose level(Eigen::Quaterniond(Eigen::AngleAxisd(std::atan2(heading.y(), heading.x()),
                                                        Eigen::Vector3d::UnitZ())),
                   first.translation());
  const Pose world_from_truth =
      Pose(so3_exp(normal(0.05 * M_PI / 180.0)), Eigen::Vector3d::Zero()) * level.inverse();
  Trajectory path;
  Pose now = world_from_truth * first;
  path.push_back({truth.front().stamp, now});
  for (std::size_t k = 1; k < truth.size(); ++k) {
    const Pose step = truth[k - 1].world_from_body.inverse() * truth[k].world_from_body;
    const double root_m = std::sqrt(step.translation().norm());
    Vector6d error;
    error << normal(5e-5 * root_m), normal(2e-3 * root_m);
    now = now * step * Pose::exp(error);
    path.push_back({truth[k].stamp, now});
  }
  return path;
}

}  // namespace understory
