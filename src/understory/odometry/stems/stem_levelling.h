#pragma once

#include <Eigen/Geometry>

#include "understory/geometry/plane/plane_grid.h"
#include "understory/sensor/stem_view.h"

namespace understory {

// What the axes of the stems of one view say about up. Trees lean, each its own way: the robust
// mean over many holds the tilt to a degree or so.
struct StemUp {
  Eigen::Vector3d up_in_body = Eigen::Vector3d::UnitZ();
  double spread_rad = 0.0;  // lean of the trees against it, per axis, robust
  int stems = 0;            // with a known axis; 0: up_in_body is what was given
  double sd_rad = 0.0;      // of up_in_body, where more than the stems knows of it; else 0
};
// `about_up` is up in the body as it is known otherwise, within 90 degrees. It tells which end of
// an axis is the upper one, and stays where fewer than three axes are known.
[[nodiscard]] StemUp stem_up(const StemView& view, const Eigen::Vector3d& about_up);
// Up of a view of which nothing else is known, unit. It is the mean of the axes if most of them
// point to one side, as those of upright stems do. Else it is the z axis of the body.
[[nodiscard]] Eigen::Vector3d up_of_axes(const StemView& view);

// A turn that makes `up_in_body` the z axis: the smallest one. Where up is more than 120 degrees
// off the z axis of the body, half a turn about the x axis comes first. The smallest turn alone
// would turn the heading by far for a little tilt.
[[nodiscard]] Eigen::Quaterniond level_from_body(const StemUp& up);

// The axis of the body that is the most upright: 0, 1 or 2.
[[nodiscard]] Eigen::Index upright_axis(const Eigen::Vector3d& up_in_body);

// Distance of a stem from the body in the plane, metres: along the two axes of the body that are
// the most level.
[[nodiscard]] double plane_range_m(const Stem& stem, const Eigen::Vector3d& up_in_body);

// The points of a view, turned by `rotation`.
[[nodiscard]] SparsePoints stem_points(const StemView& view, const Eigen::Quaterniond& rotation);

// How well the heights of a view's points are known, metres: by the variance along the axis of the
// body that is the most upright. Empty where some stem does not say.
[[nodiscard]] std::vector<double> height_sds(const StemView& view,
                                             const Eigen::Vector3d& up_in_body);

}  // namespace understory
