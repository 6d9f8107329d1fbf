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

// The trees that a canopy shows: without those that stand close to a clearly higher one, below its
// crown. The top above such a tree is its neighbour's. Trees without a height are kept.
[[nodiscard]] std::vector<Tree> without_overtopped(const std::vector<Tree>& trees);

}  // namespace understory
