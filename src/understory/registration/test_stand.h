#pragma once

#include <cstdint>
#include <vector>

#include "understory/geometry/points.h"
#include "understory/geometry/pose.h"

namespace understory::testing {

// A small stand for tests and benchmarks of matching, seen by analytic ray casting. It has rolling
// ground, stems as (leaning) cylinders, and crowns and bushes as balls that stop rays by chance.
struct Stem {
  Eigen::Vector3d foot = Eigen::Vector3d::Zero();
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
  double radius_m = 0.15;
  double length_m = 15.0;
};
struct Ball {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double radius_m = 1.0;
  double free_path_m = 1.5;
};
struct Stand {
  double bump_m = 0.0;         // height of the waves of the ground
  double bump_length_m = 8.0;  // their length
  double roughness_m = 0.0;    // of the ground, on top of the range noise
  std::vector<Stem> stems;
  std::vector<Ball> balls;
};
struct Pattern {
  int rings = 16;
  int columns = 900;
  double low_deg = -15.0;
  double high_deg = 15.0;
  double range_m = 60.0;
  double noise_m = 0.02;
};
[[nodiscard]] Pattern vlp16();
[[nodiscard]] Pattern os0_128();
[[nodiscard]] Pattern small_os0();  // of it 64 rings and 512 columns

struct StandOptions {
  double half_width_m = 40.0;
  double stems_per_hectare = 700.0;
  double bushes_per_hectare = 150.0;
  double clear_radius_m = 1.5;  // around the origin
  bool crowns = true;
};
[[nodiscard]] Stand make_stand(const StandOptions& options, std::uint64_t seed);

// Points in the frame of the sensor, ring by ring within a column.
[[nodiscard]] Points scan_stand(const Stand& stand, const Pose& world_from_sensor,
                                const Pattern& pattern, std::uint64_t seed);

// The first point in each cube of such edges, in the points' own order.
[[nodiscard]] Points thin(const Points& points, float cube_m);

// A pose with its z axis upright: m and rad.
[[nodiscard]] Pose upright(double x, double y, double z, double yaw = 0.0);

}  // namespace understory::testing
