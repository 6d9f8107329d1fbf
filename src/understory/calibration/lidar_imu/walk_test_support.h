#pragma once

#include <cmath>
#include <cstddef>
#include <numbers>
#include <string>
#include <vector>

#include "understory/calibration/lidar_imu/path_and_imu.h"
#include "understory/simulation/carrier/carrier.h"
#include "understory/simulation/sensors/inertial.h"
#include "understory/simulation/world.h"
#include "understory/util/random.h"

namespace understory {

// A simulated walk as a lidar and an IMU tell it; the lidar's path has made-up errors instead of
// cast scans.
struct SimulatedWalk {
  std::vector<StampedPose> world_from_lidar;
  ImuBuffer imu{ImuNoiseConfig(), nullptr};
  Pose lidar_from_imu;  // the truth
};

struct WalkErrors {
  double position_m = 0.004;  // of single scans, white
  double rotation_rad = 4e-4;
  double drift_m = 0.002;  // of each step from scan to scan, adding up
  double drift_rad = 2e-4;
};

inline Eigen::Vector3d normal_vector(Random& random, double sd) {
  const double x = random.normal();
  const double y = random.normal();
  return sd * Eigen::Vector3d(x, y, random.normal());
}

// `late_s`: by how much the stamps of the IMU are late.
inline SimulatedWalk simulated_walk(int seed, double duration_s, double late_s,
                                    const WalkErrors& errors = {},
                                    const std::vector<std::string>& settings = {}) {
  std::vector<std::string> all = {"scans=false",
                                  "gnss.enabled=false",
                                  "stand.size_x_m=60",
                                  "stand.size_y_m=60",
                                  "stand.trees_per_ha=0",
                                  "carrier.length_m=90",
                                  "lidar.mount_m=[0.08, -0.05, 0.12]",
                                  "lidar.mount_rpy_deg=[2, -3, 5]",
                                  "duration_s=" + std::to_string(duration_s),
                                  "imu.time_offset_s=" + std::to_string(late_s)};
  all.insert(all.end(), settings.begin(), settings.end());
  SiteConfig site = load_site("handheld", all);
  site.seed = seed;
  const SimulatedWorld world(site);
  SimulatedWalk walk;
  InertialSensor imu(site, world.plan.path, 0);
  while (to_seconds(imu.next_stamp()) < duration_s)
    walk.imu.add(imu.next());
  const std::vector<double>& rpy = site.lidar.mount_rpy_deg;
  const auto turn = [&](std::size_t axis, const Eigen::Vector3d& about) {
    return so3_exp(rpy[axis] * std::numbers::pi / 180.0 * about);
  };
  const Pose body_from_lidar(turn(2, Eigen::Vector3d::UnitZ()) * turn(1, Eigen::Vector3d::UnitY()) *
                                 turn(0, Eigen::Vector3d::UnitX()),
                             {site.lidar.mount_m[0], site.lidar.mount_m[1], site.lidar.mount_m[2]});
  walk.lidar_from_imu = body_from_lidar.inverse() * imu.body_from_imu();
  Random random(static_cast<std::uint64_t>(seed), 77);
  Pose estimate = world.plan.path.pose(0.0) * body_from_lidar;
  Pose last = estimate;
  for (double t = 0.0; t < duration_s; t += 0.1) {
    const Pose truth = world.plan.path.pose(t) * body_from_lidar;
    const Pose drift(so3_exp(normal_vector(random, errors.drift_rad)),
                     normal_vector(random, errors.drift_m));
    estimate = estimate * (last.inverse() * truth) * drift;
    last = truth;
    const Pose noise(so3_exp(normal_vector(random, errors.rotation_rad)),
                     normal_vector(random, errors.position_m));
    walk.world_from_lidar.push_back({from_seconds(t), estimate * noise});
  }
  return walk;
}

// Calls on_sample(ImuSample) and on_scan(number of the scan, its pose) in the order of a recording.
template <typename OnSample, typename OnScan>
void replay(const SimulatedWalk& walk, const OnSample& on_sample, const OnScan& on_scan) {
  const auto samples =
      walk.imu.samples(walk.world_from_lidar.front().stamp, walk.world_from_lidar.back().stamp);
  std::size_t next = 0;
  for (std::size_t i = 0; i < walk.world_from_lidar.size(); ++i) {
    const StampedPose& pose = walk.world_from_lidar[i];
    for (; next < samples.size() && samples[next].stamp <= pose.stamp; ++next) {
      ImuSample sample;
      sample.stamp = samples[next].stamp;
      sample.angular_rate = samples[next].angular_rate();
      sample.specific_force = samples[next].specific_force();
      on_sample(sample);
    }
    on_scan(i, pose);
  }
}

}  // namespace understory
