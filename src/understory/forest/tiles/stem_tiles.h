#pragma once

#include <cstdint>
#include <vector>

#include "understory/forest/ground/canopy.h"
#include "understory/forest/ground/ground.h"
#include "understory/forest/stems/stem_detector.h"
#include "understory/forest/tiles/tiled_cloud.h"
#include "understory/util/progress.h"

namespace understory {

// What one run through a cloud gathers to look for stems in it, and the stems.
struct StemHarvest {
  CanopyCeiling ceiling;  // settled
  std::uint64_t points = 0;
  std::uint64_t without_ground = 0;
  std::uint64_t near_breast = 0;   // points in the heights that are searched
  std::vector<SlicePoint> slices;  // see InventoryResult
  std::vector<StemFit> stems;      // by x, then y
};

// Stems of a cloud, tile by tile: they are the same whatever the tiles are, as what is farther from
// a stem than stem_search_reach has no influence on it. (Where stems or circles compete with each
// other in a row of 3 m and more, the first of the row may; not one has been seen.) Slices and
// stems are relative to `origin` (world frame). Polls `progress`.
[[nodiscard]] StemHarvest find_stems(const TiledCloud& cloud, const GroundModel& ground,
                                     const Eigen::Vector3d& origin,
                                     const StemDetectorConfig& config,
                                     const ProgressSink& progress);

}  // namespace understory
