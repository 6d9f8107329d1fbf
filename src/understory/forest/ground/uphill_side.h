#pragma once

#include <Eigen/Core>

#include "understory/geometry/raster.h"

namespace understory {

// How much higher the ground is at the uphill side of a stem than at its axis, metres: the highest
// ground around it. Breast height is taken from there. `foot`: of the axis, in the frame of the
// terrain; `radius_m`: of the stem at breast height. 0 on even ground and where none is known.
[[nodiscard]] double uphill_rise_m(const Raster& terrain, const Eigen::Vector2d& foot,
                                   double radius_m);

}  // namespace understory
