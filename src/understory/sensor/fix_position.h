#pragma once

#include <cmath>

#include "understory/sensor/gnss_fix.h"

namespace understory {

// Whether a fix has a place on the globe, in the ranges of latitude and longitude.
[[nodiscard]] inline bool has_position(const GnssFix& fix) {
  return fix.quality != 0 && std::isfinite(fix.latitude_deg) && std::isfinite(fix.longitude_deg) &&
         std::abs(fix.latitude_deg) <= 90.0 && std::abs(fix.longitude_deg) <= 360.0;
}

}  // namespace understory
