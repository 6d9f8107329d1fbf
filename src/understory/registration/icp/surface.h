#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>

namespace understory {

// What the neighbourhood of a target point constrains.
enum class SurfaceKind : std::uint8_t {
  kPoint,    // all three directions (point to point)
  kPlane,    // along the normal
  kPole,     // across the axis
  kNothing,  // the trace of a ring, or foliage
};

// A neighbourhood summed up, from any origin near it.
struct SurfaceSums {
  std::size_t count = 0;
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  Eigen::Matrix3f products = Eigen::Matrix3f::Zero();

  void add(const Eigen::Vector3f& d) {
    ++count;
    sum += d;
    products += d * d.transpose();
  }
};

// The surface through a neighbourhood, and its direction (unit; normal of a plane, axis of a pole).
// `max_planarity`: smallest through middle variance of what still is a plane.
struct SurfacePatch {
  SurfaceKind surface = SurfaceKind::kNothing;
  Eigen::Vector3f direction = Eigen::Vector3f::Zero();
};
[[nodiscard]] SurfacePatch surface_of(const SurfaceSums& sums, double max_planarity);

// A point beside the target point nearest to it.
struct IcpPair {
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();  // from the target point, axes of the target
  SurfacePatch patch;                                // of the target there
  float squared_m2 = 0.0F;
};

}  // namespace understory
