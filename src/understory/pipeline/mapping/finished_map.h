#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "understory/map/keyframes/keyframe_clouds.h"
#include "understory/map/keyframes/keyframe_map.h"
#include "understory/map/map_tiles.h"
#include "understory/util/progress.h"

namespace understory {

// All clouds at their keyframes' finished poses, sorted into tiles in `folder`. What the tiles hand
// back lies on the map's grid, as every reader of map.laz gets it.
[[nodiscard]] std::unique_ptr<MapTiles> make_finished_map(const KeyframeClouds& clouds,
                                                          const std::vector<Keyframe>& keyframes,
                                                          MapTiles::Config config,
                                                          const std::filesystem::path& folder,
                                                          const ProgressSink& progress);

}  // namespace understory
