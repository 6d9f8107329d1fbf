#pragma once

#include <cmath>

#include "understory/sensor/gnss_fix.h"

namespace understory {

// Whether latitude and longitude of a fix are a place on the globe. Receivers write 0, 0 where they
// have none.
[[nodiscard]] inline bool is_on_globe(const GnssFix& fix) {
  return std::isfinite(fix.latitude_deg) && std::isfinite(fix.longitude_deg) &&
         std::abs(fix.latitude_deg) <= 90.0 && std::abs(fix.longitude_deg) <= 360.0 &&
         (fix.latitude_deg != 0.0 || fix.longitude_deg != 0.0);
}

// Whether a fix has a place by its receiver as well.
[[nodiscard]] inline bool has_position(const GnssFix& fix) {
  return fix.quality != 0 && is_on_globe(fix);
}

}  // namespace understory
