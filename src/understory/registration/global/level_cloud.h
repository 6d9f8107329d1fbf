#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "understory/geometry/points.h"
#include "understory/geometry/pose.h"

namespace understory {

// One point per voxel of `edge_m`: the mean of its points, in the order in which voxels were first
// met. Metres, frame of the points. Points that are not finite, or farther than 100 km from the
// origin, are left out.
[[nodiscard]] Points voxel_means(const Points& points, double edge_m);

// Which way is up in a cloud, as its upright things tell it.
struct UpEstimate {
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  // unit, frame of the points
  double weight = 0.0;  // points of the stems and walls that agree within 5 degrees; 0: none
};

// Up from lines along stems and from normals of upright surfaces, which are level whatever the
// slope of the ground. It is sought within 40 degrees of z; z where nothing upright shows.
// Thread-safe, deterministic.
[[nodiscard]] UpEstimate estimate_up(const Points& points);

// Heights of the ground under a levelled cloud, in cells of 1 m. Immutable, thread-safe.
class GroundGrid {
 public:
  // `points`: z up, metres.
  explicit GroundGrid(const Points& points);
  // Height of the ground, metres; beyond the cloud that of its edge. 0 for a cloud without ground.
  [[nodiscard]] float at(float x, float y) const;

 private:
  void spread();

  Eigen::Vector2f low_ = Eigen::Vector2f::Zero();
  int columns_ = 0;
  int rows_ = 0;
  std::vector<float> heights_;
};

}  // namespace understory
