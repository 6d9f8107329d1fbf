#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "understory/map/keyframe_clouds.h"
#include "understory/map/keyframe_map.h"
#include "understory/map/map_tiles.h"
#include "understory/util/progress.h"

namespace understory {

// All clouds at their keyframes' finished poses, sorted into tiles in `folder`. `stored_place`: see
// MapTiles.
[[nodiscard]] std::unique_ptr<MapTiles> make_finished_map(const KeyframeClouds& clouds,
                                                          const std::vector<Keyframe>& keyframes,
                                                          const MapTiles::Config& config,
                                                          const std::filesystem::path& folder,
                                                          const ProgressSink& progress,
                                                          MapTiles::StoredPlace stored_place = {});

}  // namespace understory
