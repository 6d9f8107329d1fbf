#pragma once

#include <filesystem>
#include <vector>

#include "understory/pipeline/georeferencing/movable_run.h"
#include "understory/sensor/tree.h"

namespace understory {

// Tops of the run's own canopy model (chm.tif) as trees: x, y of the top and the height above
// ground. z is that of the ground below (dtm.tif), NaN where unknown. World frame, metres. Maps
// from the air hold tops, and a tree that leans has its top elsewhere than its foot. Empty where
// the folder holds no canopy model. Throws InputError where it cannot be read.
[[nodiscard]] std::vector<Tree> tops_of_run(const std::filesystem::path& folder,
                                            const MovableRun& run);

}  // namespace understory
