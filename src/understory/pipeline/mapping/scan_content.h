#pragma once

#include <cstdint>

#include "understory/sensor/scan.h"

namespace understory {

// A number that is the same for scans with the same points and, but for chance, for no others: a
// lidar's noise never gives the same scan twice. Every eighth point is looked at.
[[nodiscard]] std::uint64_t content_of(const Scan& scan);

}  // namespace understory
