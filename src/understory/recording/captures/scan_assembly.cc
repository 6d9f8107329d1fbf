#include "understory/recording/captures/scan_assembly.h"

#include <algorithm>
#include <limits>

namespace understory {

ScanPtr make_scan(std::vector<ScanPoint>& points, std::vector<TimeNs>& times, int ring_count) {
  ScanPtr result;
  if (!points.empty()) {
    auto scan = std::make_shared<Scan>();
    scan->stamp = *std::min_element(times.begin(), times.end());
    scan->ring_count = ring_count;
    scan->points.reserve(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      const TimeNs t = times[i] - scan->stamp;
      if (t > std::numeric_limits<std::uint32_t>::max()) continue;
      scan->points.push_back(points[i]);
      scan->points.back().t_ns = static_cast<std::uint32_t>(t);
    }
    result = std::move(scan);
  }
  points.clear();
  times.clear();
  return result;
}

}  // namespace understory
