#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "understory/geometry/points.h"
#include "understory/geometry/pose.h"
#include "understory/geometry/voxel_index.h"
#include "understory/util/config/config.h"

namespace understory {

// Which patches of a view count as flat surfaces.
struct SurfaceViewConfig {
  double cell_m = 1.0;        // edge of the cells; each has one patch at most
  double range_max_m = 30.0;  // farther points are left out: there the beams are all but parallel
  int min_points = 8;         // of a patch
  double max_thickness_m = 0.08;  // standard deviation along the normal, of a patch
  // Smallest and middle standard deviation of a patch's points, over the cell's edge: less is the
  // trace of one ring. Points spread evenly over the cell have 0.29.
  double min_width = 0.12;
};
void describe(ConfigTable& table, SurfaceViewConfig& config);

// A flat piece of ground, wall or stem, and how the lidar saw it; view frame.
struct FlatPatch {
  Eigen::Vector3d mean;    // of its points, metres
  Eigen::Vector3d normal;  // unit, towards the lidar
  Eigen::Vector3d ray;     // mean of the unit vectors from the lidar to its points
};

// One cloud of a view and where it was taken.
struct ViewCloud {
  const Points* points_in_body = nullptr;
  Pose view_from_body;
};

// The flat patches that a few clouds show which were taken near each other, at most one in each
// cell of a grid. Immutable, thread-safe.
class SurfaceView {
 public:
  //   lidar_in_body: where the beams begin, metres
  SurfaceView(std::span<const ViewCloud> clouds, const Eigen::Vector3d& lidar_in_body,
              const SurfaceViewConfig& config);

  [[nodiscard]] const std::vector<FlatPatch>& patches() const { return patches_; }
  // The patch with the nearest mean of those in the cell around a point and the 26 cells beside;
  // null: there is none.
  [[nodiscard]] const FlatPatch* nearest(const Eigen::Vector3d& point_in_view) const;

 private:
  double cell_m_;
  std::vector<FlatPatch> patches_;
  VoxelIndex index_;  // of their cells
};

}  // namespace understory
