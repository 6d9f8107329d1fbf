#pragma once

#include <cstddef>
#include <vector>

#include "understory/forest/stems/stem_detector.h"

namespace understory {

// For each stem the number of the thickest one that it shares a foot with: its own where it stands
// alone. Two stems share a foot where their surfaces meet between the ground and breast height, and
// their centre lines go apart upwards. A third one that shares a foot with either is of the same.
[[nodiscard]] std::vector<std::size_t> shared_feet(const std::vector<StemFit>& stems);

}  // namespace understory
