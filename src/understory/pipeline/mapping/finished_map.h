#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "understory/geometry/stamped_pose.h"
#include "understory/map/carrier_region.h"
#include "understory/map/keyframes/keyframe_clouds.h"
#include "understory/map/keyframes/keyframe_map.h"
#include "understory/map/map_tiles.h"
#include "understory/util/progress.h"

namespace understory {

// What carries the lidar, and stays out of the finished map.
struct LeftOutCarrier {
  CarrierRegion region;
  std::span<const StampedPose> path;  // of the scans, finished, in order of time
  std::uint64_t points = 0;           // that were left out
  std::uint64_t of = 0;               // of so many
};

// All clouds at their keyframes' finished poses, sorted into tiles in `folder`. What the tiles hand
// back lies on the map's grid, as every reader of map.laz gets it. Points in the region of
// `carrier` are left out, and counted there.
[[nodiscard]] std::unique_ptr<MapTiles> make_finished_map(
    const KeyframeClouds& clouds, const std::vector<Keyframe>& keyframes, MapTiles::Config config,
    const std::filesystem::path& folder, LeftOutCarrier& carrier, const ProgressSink& progress);

}  // namespace understory
