#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "understory/geometry/stamped_pose.h"
#include "understory/map/carrier_region.h"
#include "understory/map/clouds/map_tiles.h"
#include "understory/map/keyframes/keyframe_clouds.h"
#include "understory/map/keyframes/keyframe_map.h"
#include "understory/util/progress.h"

namespace understory {

// What carries the lidar, and stays out of the finished map.
struct LeftOutCarrier {
  CarrierRegion region;
  std::span<const StampedPose> path;  // of the scans, finished, in order of time
  std::uint64_t points = 0;           // that were left out
  std::uint64_t of = 0;               // of so many
};

// The clouds that a finished map is made of.
struct MapClouds {
  const KeyframeClouds& whole;
  const KeyframeClouds* far = nullptr;  // of far points, between them; null: none
  double far_m = 0.0;                   // what is nearer to the body is seen from near
};

// All clouds at their keyframes' finished poses, sorted into tiles in `folder`. What the tiles hand
// back lies on the map's grid, as every reader of map.laz gets it. Points in the region of
// `carrier` are left out, and counted there. Of the far clouds only those points enter whose column
// no whole cloud shows from near.
[[nodiscard]] std::unique_ptr<MapTiles> make_finished_map(
    const MapClouds& clouds, const std::vector<Keyframe>& keyframes, MapTiles::Config config,
    const std::filesystem::path& folder, LeftOutCarrier& carrier, const ProgressSink& progress);

}  // namespace understory
