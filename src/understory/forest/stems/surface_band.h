#pragma once

#include <algorithm>

#include "understory/forest/stem_constants.h"

namespace understory {

// m: points no farther from the surface of a stem than this are on it. `scatter_m`: standard
// deviation of the points about the surface, 0 or more.
[[nodiscard]] inline double surface_band_m(double scatter_m) {
  using namespace stem_constants::surface_band;
  return std::max(kBandScatters * scatter_m, kLeastBand);
}

// m: points whose distance from the surface is below this negative one are inside of the stem.
// `band_m`: of its surface, over 0. `radius_m`: over 0.
[[nodiscard]] inline double inside_from_m(double band_m, double radius_m) {
  using namespace stem_constants::surface_band;
  return -std::max(kInsideBands * band_m, kInsideShare * radius_m);
}

}  // namespace understory
