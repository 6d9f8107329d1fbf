#pragma once

#include <cstdint>
#include <vector>

#include "understory/sensor/scan.h"
#include "understory/util/config/config.h"

namespace understory {

// Which returns near the lidar stand alone: snow flakes, rain, insects, echoes out of nothing. What
// falls around a moving lidar is measured where the lidar is. It holds matches back, since its
// points of one scan meet those of the scan before. P3 says so in F6 and the lessons below it:
// "even a light snow fall will be visible in the map".
struct IsolatedPointsConfig {
  double within_m = 8.0;  // of the lidar; farther away thin stems give single points too; 0: none
  double gap_m = 0.25;    // to its neighbours on its ring, beyond which it is alone
};
void describe(ConfigTable& table, IsolatedPointsConfig& config);

// Sets `keep` to 0 for every point of the scan (lidar frame, as measured) that is nearer than
// `within_m` and isolated. Such a point is farther than `gap_m` from the two returns of its own
// ring before it and the two after it. `keep` has an entry a point, or is empty and made where
// something is dropped. Points of a ring lie in the order in which they were measured. A scan
// without rings, or most of whose near points would go, has no such order and is left as it is.
// Returns how many stood alone. Thread-safe.
std::size_t drop_isolated(const Scan& scan, const IsolatedPointsConfig& config,
                          std::vector<std::uint8_t>& keep);

}  // namespace understory
