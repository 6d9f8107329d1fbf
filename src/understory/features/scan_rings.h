#pragma once

#include "understory/sensor/scan.h"

namespace understory {

// Whether the points of each ring share an elevation, as those of a spinning lidar do in its own
// frame. False for lines of a sensor whose pattern does not repeat. Such a line sweeps over the
// whole field of view, and no stem can be cut along it. Also true where the scan has too few points
// to tell, or no ring numbers.
[[nodiscard]] bool has_level_rings(const Scan& scan);

}  // namespace understory
