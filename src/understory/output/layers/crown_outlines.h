#pragma once

#include <vector>

#include "understory/forest/inventory.h"
#include "understory/output/layers/geo_files.h"

namespace understory {

// The crowns of an inventory's trees, seen from above: metres, world frame, in the order of the
// list. That of a tree with a stem is convex. That of a tree by its crown alone follows the cells
// of the canopy model, whose open edge counts half in `crown_area_m2`. A basic inventory has none.
[[nodiscard]] std::vector<CrownOutline> crown_outlines(const InventoryResult& inventory);

}  // namespace understory
