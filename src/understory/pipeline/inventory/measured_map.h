#pragma once

#include <filesystem>

#include "understory/evaluation/trajectory.h"
#include "understory/forest/measured_cloud.h"
#include "understory/map/map_tiles.h"
#include "understory/pipeline/inventory/stand_cloud.h"

namespace understory {

// A finished map with the times of its points, and the path of the body that it was measured from.
// `tiles` outlives the result.
[[nodiscard]] MeasuredCloud measured_map(MapTiles& tiles, const Trajectory& path);

// The same of the map of a run folder that was read again. Nothing where the folder has no path, or
// the map no times. `map` outlives the result. Throws InputError as read_trajectory does.
[[nodiscard]] MeasuredCloud measured_in_run(const std::filesystem::path& run,
                                            const StandCloud& map);

}  // namespace understory
