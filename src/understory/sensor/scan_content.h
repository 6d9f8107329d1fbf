#pragma once

#include <cstdint>

#include "understory/sensor/scan.h"

namespace understory {

// A number that is the same for scans with the same points and, but for chance, for no others. A
// lidar's noise never gives the same scan twice. Every eighth point is looked at. 0: no points.
[[nodiscard]] std::uint64_t content_of(const Scan& scan);

// Whether a scan repeats the one before, from what content_of() says of them. Scans without points
// are no repetition: a covered lidar sends them in a row.
[[nodiscard]] bool is_repetition(std::uint64_t content, std::uint64_t content_before);

}  // namespace understory
