#pragma once

#include <Eigen/Core>
#include <vector>

#include "understory/geometry/plane/plane_grid.h"
#include "understory/geometry/pose.h"

namespace understory {

// What one view sees of the plane: a sector, P0 figure 8.
struct ViewCone {
  double range_m = 0.0;         // R: nine of ten stems lie nearer
  double half_angle_rad = 0.0;  // pi: all around
  double middle_rad = 0.0;      // of the sector, from the x axis of the view towards its y axis
};

// The sector that most stems of the views lie in, from the views themselves: nothing about the
// scanner has to be known. Its middle is the views' x axis, as in P0, unless a sector about another
// direction is clearly narrower. So is that of a lidar that looks backwards in its own frame, where
// nothing tells how it is mounted. An empty sector (range 0) for views without stems.
// Deterministic.
[[nodiscard]] ViewCone estimate_view_cone(const std::vector<SparsePoints>& level_views);

// Overlap of two views by their poses alone, P0 section 2.4 and figure 8. It is the share of the
// one's sector that lies in the other's too, seen from above. Heights and tilt do not count.
// Immutable, thread-safe.
class ConeOverlap {
 public:
  explicit ConeOverlap(const ViewCone& cone);

  // lambda, 0..1, exact to about a hundredth. Symmetric up to that.
  [[nodiscard]] double operator()(const Pose& world_from_a, const Pose& world_from_b) const;
  // Whether a point of a view's level frame lies in its sector.
  [[nodiscard]] bool holds(const Eigen::Vector3d& point_in_view) const;
  [[nodiscard]] const ViewCone& cone() const { return cone_; }

 private:
  ViewCone cone_;
  std::vector<Eigen::Vector2d> samples_;  // spread evenly over the sector
};

}  // namespace understory
