#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "understory/geometry/points.h"

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

// Covariance of a neighbourhood, m^2. Nothing where it is the trace of a ring of the lidar on level
// ground, which tells nothing, or too few points. P3 (3): W of a point of the map.
[[nodiscard]] std::optional<Eigen::Matrix3f> covariance_of(const SurfaceSums& sums);
// Of each point of a cloud, from its `neighbours` (4 to 100) nearest points, m^2. Traces of rings
// count as what they are: long, and thin across.
[[nodiscard]] std::vector<Eigen::Matrix3f> covariances_of(const Points& points, int neighbours);

// The surface around each point of a cloud, found from its `neighbours` (4 to 100) nearest points.
[[nodiscard]] std::vector<SurfacePatch> surfaces_of(const Points& points, int neighbours,
                                                    double max_planarity);

// A point beside the target point nearest to it.
struct IcpPair {
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();  // from the target point, axes of the target
  SurfacePatch patch;                                // of the target there
  float squared_m2 = 0.0F;
};

}  // namespace understory
