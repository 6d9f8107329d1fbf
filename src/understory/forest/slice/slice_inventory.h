#pragma once

#include <string>

#include "understory/forest/inventory.h"

namespace understory {

// The stems of a cloud that is one thin cut through a stand near breast height, whatever its z.
// Ground, heights and lean are unknown: `ground.terrain` is the middle of the cut lowered by 1.3 m,
// only to draw it; there is no canopy. Trees have z of the middle of the cut around them. The cut
// may follow a slope. Deterministic for any number of threads. Throws InputError,
// with `name` as its file, for a cloud that is thicker than a cut, and Stopped.
[[nodiscard]] InventoryResult take_slice(const PointBlocks& cloud, const std::string& name,
                                         const InventoryConfig& config,
                                         const ProgressSink& progress = {});

}  // namespace understory
