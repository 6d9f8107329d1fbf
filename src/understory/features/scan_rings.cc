#include "understory/features/scan_rings.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "understory/features/features_constants.h"

namespace understory {
namespace {

// Sums over the elevations of one ring.
struct RingSpread {
  double count = 0.0;
  double sum = 0.0;
  double squares = 0.0;
  [[nodiscard]] double sd() const {
    const double mean = sum / count;
    return std::sqrt(std::max(0.0, squares / count - mean * mean));
  }
};

}  // namespace

bool has_level_rings(const Scan& scan) {
  using namespace features_constants::scan_rings;
  std::uint16_t highest = 0;
  for (const ScanPoint& point : scan.points)
    highest = std::max(highest, point.ring);
  std::vector<RingSpread> rings(static_cast<std::size_t>(highest) + 1);
  for (const ScanPoint& point : scan.points) {
    const double elevation =
        std::atan2(static_cast<double>(point.z),
                   std::hypot(static_cast<double>(point.x), static_cast<double>(point.y)));
    RingSpread& ring = rings[point.ring];
    ring.count += 1.0;
    ring.sum += elevation;
    ring.squares += elevation * elevation;
  }
  std::size_t told = 0;
  std::size_t level = 0;
  for (const RingSpread& ring : rings) {
    if (ring.count < kFewestPoints) continue;
    ++told;
    level += ring.sd() < kMostSdRad ? 1 : 0;
  }
  return told < 2 || 2 * level >= told;
}

}  // namespace understory
