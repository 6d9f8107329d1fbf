#pragma once

#include <string>
#include <vector>

#include "understory/forest/inventory.h"
#include "understory/forest/tiles/stem_tiles.h"

namespace understory {

// What the user has to know of an inventory that is otherwise finished. It tells of trees that may
// be missing, ground that was not seen and heights that are not known.
[[nodiscard]] std::vector<std::string> remarks_on(const StemHarvest& gathered,
                                                  const InventoryConfig& config,
                                                  const InventoryResult& result);

}  // namespace understory
