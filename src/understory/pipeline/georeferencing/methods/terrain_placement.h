#pragma once

#include <optional>
#include <vector>

#include "understory/georeference/terrain_fit.h"
#include "understory/pipeline/georeferencing/georeferencing.h"
#include "understory/pipeline/georeferencing/methods/placement.h"
#include "understory/pipeline/georeferencing/movable_run.h"

namespace understory {

// A run that was laid on a terrain model.
struct LevelledRun {
  TerrainFit fit;
  Pose target_from_world;
};

// Lays the ground of the run (its terrain model, else the feet of its trees) on that of the
// request. `placed` is where the run lies about, in the frame east, north, up at `origin` (without
// one: the model's own frame). Throws InputError where there is no ground or it is not found.
[[nodiscard]] LevelledRun level_run(const GeoreferenceRequest& request, const MovableRun& run,
                                    const Pose& placed, const std::optional<GeodeticPlace>& origin,
                                    const TerrainFitConfig& config);

// Its figures, summary, inputs, and a doubt where most of the ground lies elsewhere.
void tell_levelled(const GeoreferenceRequest& request, const LevelledRun& levelled,
                   Placement& placement);

}  // namespace understory
