#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "understory/forest/ground/canopy.h"
#include "understory/forest/ground/ground.h"
#include "understory/forest/stand/seen_area.h"
#include "understory/forest/stems/stem_detector.h"
#include "understory/forest/tiles/tile_shelf.h"
#include "understory/forest/tiles/tiled_cloud.h"
#include "understory/forest/trees/low_heights.h"
#include "understory/forest/trees/thin_coverage.h"
#include "understory/util/progress.h"

namespace understory {

// What one run through a cloud gathers to look for stems in it, and the stems.
struct StemHarvest {
  CanopyCeiling ceiling;  // settled
  std::uint64_t points = 0;
  std::uint64_t without_ground = 0;
  std::uint64_t near_breast = 0;  // points in the heights that are searched
  LowHeights low;
  CoverageGrid coverage;
  SeenCells seen;
  std::vector<SlicePoint> slices;  // see InventoryResult
  // All thinned points of each tile, where there are several.
  std::optional<TileShelf<SlicePoint>> thinned;
  std::vector<StemFit> stems;  // by x, then y; measured at breast height
  double blur_m = 0.0;         // see add_blurred_stems
  double range_noise_m = 0.0;  // see range_noise_of
};

// The thinned points of a cloud by their places, relative to the origin of its inventory (world
// frame). All it is made of outlives it.
class SlicesNear {
 public:
  SlicesNear(const std::vector<SlicePoint>& whole,
             const std::optional<TileShelf<SlicePoint>>& thinned, const TiledCloud& cloud,
             const Eigen::Vector3d& origin)
      : whole_(whole), thinned_(thinned), cloud_(cloud), origin_(origin) {}
  // Those in an area; of a cloud in one piece all.
  [[nodiscard]] std::vector<SlicePoint> in(const GroundArea& area) const;
  // Calls the visitor for each of those in an area, and only for them.
  void visit(const GroundArea& area, const std::function<void(const SlicePoint&)>& visitor) const;

 private:
  const std::vector<SlicePoint>& whole_;
  const std::optional<TileShelf<SlicePoint>>& thinned_;
  const TiledCloud& cloud_;
  Eigen::Vector3d origin_;
};

// Stems of a cloud, tile by tile. They are the same whatever the tiles are: what is farther from a
// stem than stem_search_reach has no influence on it. Only the blur and the noise are those of the
// whole cloud. (In a row of 3 m and more, where stems or circles compete, the first of the row may
// have influence; no case has been seen.) Slices and stems are relative to `origin` (world frame).
// Polls `progress`.
[[nodiscard]] StemHarvest find_stems(const TiledCloud& cloud, const GroundModel& ground,
                                     const Eigen::Vector3d& origin,
                                     const StemDetectorConfig& config,
                                     const ProgressSink& progress);

}  // namespace understory
