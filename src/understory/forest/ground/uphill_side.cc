#include "understory/forest/ground/uphill_side.h"

#include <cmath>

#include "understory/forest/forest_constants.h"

namespace understory {

double uphill_rise_m(const Raster& terrain, const Eigen::Vector2d& foot, double radius_m) {
  using forest_constants::uphill_side::kDirections;
  const double axis = terrain.interpolate(foot.x(), foot.y());
  double rise = 0.0;
  for (int k = 0; k < kDirections; ++k) {
    const double turn = 2.0 * M_PI * k / kDirections;
    const double side = terrain.interpolate(foot.x() + radius_m * std::cos(turn),
                                            foot.y() + radius_m * std::sin(turn));
    if (side - axis > rise) rise = side - axis;  // not where either is unknown
  }
  return rise;
}

}  // namespace understory
