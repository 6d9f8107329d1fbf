#pragma once

#include "understory/forest/inventory.h"

namespace understory {

// The stems of a cloud that is one thin cut through a stand near breast height, whatever its z.
// Ground, heights and lean are unknown: `ground.terrain` is a plane 1.3 m below the middle of the
// cut, only to draw it; there is no canopy. Trees have z of the middle of the cut. Deterministic
// for any number of threads. Throws Stopped.
[[nodiscard]] InventoryResult take_slice(const PointBlocks& cloud, const InventoryConfig& config,
                                         const ProgressSink& progress = {});

}  // namespace understory
