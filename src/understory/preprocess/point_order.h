#pragma once

#include "understory/sensor/scan.h"

namespace understory {

// Whether the times of a scan's points are in no order. Then points that follow each other in time
// lie no nearer in direction than points drawn at random. Beams of every lidar sweep, those of a
// spinning one around its axis and others along a curve. Without order a driver or a converter has
// mixed the times up. The order of the rows does not matter. `scan` in the frame of the lidar or of
// the body. False where there are too few points or times to tell. Looks at 2,000 points at most.
// Deterministic.
[[nodiscard]] bool times_in_no_order(const Scan& scan);

}  // namespace understory
