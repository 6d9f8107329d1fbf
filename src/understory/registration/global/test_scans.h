#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <vector>

#include "understory/geometry/points.h"
#include "understory/geometry/pose.h"
#include "understory/util/random.h"

namespace understory::testing {

// A scan of 48 rings with 1 cm of noise, in the frame of the lidar. `scene.cast(eye, ray)` gives
// the range along a unit ray, 0 where nothing is hit.
template <typename Scene>
[[nodiscard]] Points scan_rings(const Scene& scene, const Pose& world_from_lidar, int columns,
                                std::uint64_t seed) {
  Random random(seed);
  Points points;
  for (int ring = 0; ring < 48; ++ring) {
    const double elevation = (-28.0 + 1.2 * ring) * M_PI / 180.0;
    for (int k = 0; k < columns; ++k) {
      const double azimuth = 2.0 * M_PI * k / columns;
      const Eigen::Vector3d ray(std::cos(elevation) * std::cos(azimuth),
                                std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
      const double range =
          scene.cast(world_from_lidar.translation(), world_from_lidar.rotation() * ray);
      if (range > 0.5) points.push_back(((range + 0.01 * random.normal()) * ray).cast<float>());
    }
  }
  return points;
}

// A plane stand of round stems on rolling ground, and what one lidar sees of it: for tests of
// matching without a guess.
struct ScanStand {
  std::vector<Eigen::Vector2d> stems;
  double radius_m = 0.14;

  explicit ScanStand(std::uint64_t seed, int count = 180, double half_side_m = 32.0) {
    Random random(seed);
    while (static_cast<int>(stems.size()) < count) {
      const Eigen::Vector2d at(random.uniform(-half_side_m, half_side_m),
                               random.uniform(-half_side_m, half_side_m));
      bool free = true;
      for (const Eigen::Vector2d& other : stems)
        free = free && (other - at).norm() > 1.8;
      if (free) stems.push_back(at);
    }
  }
  [[nodiscard]] static double ground(double x, double y) {
    return 0.4 * std::sin(0.13 * x) + 0.3 * std::cos(0.17 * y);
  }
  // Range along a unit ray to the nearest stem or the ground; 0: nothing within 40 m.
  [[nodiscard]] double cast(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray) const {
    double best = 40.0;
    const double level = ray.head<2>().norm();
    for (const Eigen::Vector2d& stem : stems) {
      const Eigen::Vector2d to = stem - eye.head<2>();
      const double along = to.dot(ray.head<2>()) / level;
      const double beside = std::abs(to.x() * ray.y() - to.y() * ray.x()) / level;
      if (along <= 0.0 || beside >= radius_m) continue;
      const double range = (along - std::sqrt(radius_m * radius_m - beside * beside)) / level;
      const double height = eye.z() + range * ray.z() - ground(stem.x(), stem.y());
      if (range < best && height < 14.0) best = range;
    }
    for (double range = 0.5; range < best; range += 0.25) {
      const Eigen::Vector3d at = eye + range * ray;
      const double below = ground(at.x(), at.y()) - at.z();
      if (below < 0.0) continue;
      best = range - below / std::max(0.05, -ray.z());
      break;
    }
    return best < 40.0 ? best : 0.0;
  }
  // In the frame of the lidar.
  [[nodiscard]] Points scan(const Pose& world_from_lidar, std::uint64_t seed) const {
    return scan_rings(*this, world_from_lidar, 640, seed);
  }
};

}  // namespace understory::testing
