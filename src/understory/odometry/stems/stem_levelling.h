#pragma once

#include <Eigen/Geometry>

#include "understory/geometry/plane_grid.h"
#include "understory/sensor/stem_view.h"

namespace understory {

// What the axes of the stems of one view say about up. Trees lean, each its own way: the robust
// mean over many holds the tilt to a degree or so.
struct StemUp {
  Eigen::Vector3d up_in_body = Eigen::Vector3d::UnitZ();
  double spread_rad = 0.0;  // lean of the trees against it, per axis, robust
  int stems = 0;            // with a known axis; 0: up_in_body is the z axis of the body
  double sd_rad = 0.0;      // of up_in_body, where more than the stems knows of it; else 0
};
[[nodiscard]] StemUp stem_up(const StemView& view);

// The smallest turn that makes `up_in_body` the z axis.
[[nodiscard]] Eigen::Quaterniond level_from_body(const StemUp& up);

// The points of a view, turned by `rotation`.
[[nodiscard]] SparsePoints stem_points(const StemView& view, const Eigen::Quaterniond& rotation);

// How well the heights of a view's points are known; empty where some stem does not say.
[[nodiscard]] std::vector<double> height_sds(const StemView& view);

}  // namespace understory
