#pragma once

#include <vector>

#include "understory/sensor/scan.h"
#include "understory/util/time.h"

namespace understory {

// A scan of points whose absolute times stand beside them: its stamp is the earliest. Both vectors
// are emptied but keep their memory. Null if there are no points. Points more than 4 s after the
// first (which t_ns cannot hold) are left out.
[[nodiscard]] ScanPtr make_scan(std::vector<ScanPoint>& points, std::vector<TimeNs>& times,
                                int ring_count);

}  // namespace understory
