#include "understory/sensor/scan.h"

#include <algorithm>

namespace understory {

TimeNs Scan::end() const {
  std::uint32_t last = 0;
  for (const ScanPoint& point : points)
    last = std::max(last, point.t_ns);
  return stamp + static_cast<TimeNs>(last);
}

}  // namespace understory
