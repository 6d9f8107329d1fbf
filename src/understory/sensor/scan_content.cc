#include "understory/sensor/scan_content.h"

#include <bit>
#include <cstddef>

namespace understory {

std::uint64_t content_of(const Scan& scan) {
  if (scan.points.empty()) return 0;
  constexpr std::size_t kEvery = 8;
  constexpr std::uint64_t kFactor = 0x9E3779B97F4A7C15U;
  std::uint64_t sum = scan.points.size() + 1;
  for (std::size_t i = 0; i < scan.points.size(); i += kEvery) {
    const ScanPoint& p = scan.points[i];
    const std::uint64_t xy =
        std::uint64_t{std::bit_cast<std::uint32_t>(p.x)} << 32U | std::bit_cast<std::uint32_t>(p.y);
    sum = (sum ^ xy) * kFactor;
    sum = (std::rotl(sum, 29) ^ std::bit_cast<std::uint32_t>(p.z)) * kFactor;
  }
  return sum;
}

bool is_repetition(std::uint64_t content, std::uint64_t content_before) {
  return content != 0 && content == content_before;
}

}  // namespace understory
