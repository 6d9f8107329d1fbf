#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "understory/forest/dead_wood/dead_wood.h"
#include "understory/forest/form/stem_curve.h"
#include "understory/forest/ground/canopy.h"
#include "understory/forest/ground/ground.h"
#include "understory/forest/stems/stem_detector.h"
#include "understory/forest/tiles/stem_tiles.h"
#include "understory/forest/tiles/tile_shelf.h"
#include "understory/forest/tiles/tiled_cloud.h"
#include "understory/forest/trees/occupied_space.h"
#include "understory/forest/trees/tree_crowns.h"
#include "understory/forest/trees/tree_owners.h"
#include "understory/forest/trees/tree_sheets.h"
#include "understory/util/progress.h"

namespace understory {

// What is measured above the stems that were found. All places are relative to `origin` (world
// frame), heights above the ground.
struct CrownTask {
  const TiledCloud& cloud;
  const GroundModel& ground;
  Eigen::Vector3d origin;
  const std::vector<StemFit>& stems;  // by x, then y
  const SlicesNear& slices;
  const CanopyCeiling& ceiling;  // settled
  double slices_end_m;
  bool low_tops;  // trees may end below that: see TreeColumns::top
  bool full;      // stem curves and crowns as well
  bool space;     // what stands in the way of a view as well
  const StemCurveConfig& curves;
  const ProgressSink& progress;
};

// Tops and curves of the stems, and what the crowns are found in.
struct StemTops {
  std::vector<double> top_m;          // of each stem; NaN where it is not known
  std::vector<int> top_points;        // of each stem: points in the half metre below its height
  std::vector<int> top_metre_points;  // of each stem: in the metre below it
  std::vector<int> beyond_points;     // of each stem: in the four metres above it
  std::vector<int> sky_points;        // of each stem: from eight to sixteen metres above it
  std::vector<StemCurve> curves;      // of each stem, in a full inventory
  StemSheets sheets;                  // of each stem that is most in doubt
  CanopyGrid canopy;
  OccupiedSpace space;             // where it is asked for
  TileShelf<std::uint64_t> cubes;  // of each tile: see TreeOwners
  TileShelf<SlicePoint> low;       // of each tile of a full inventory: see LowPoints
};

// Height of a stem's top as it is listed, from what the cloud shows: NaN where it may go on.
using ListedHeight = std::function<double(std::size_t stem, double top_m)>;

// One run through the cloud, tile by tile: the same whatever the tiles are. Polls `progress`.
[[nodiscard]] StemTops look_up(const CrownTask& task, double canopy_cell_m,
                               const ListedHeight& listed);

// The owners of a cloud's cubes, tile by tile. A cube belongs to the tile with its lower corner.
class OwnerTiles {
 public:
  OwnerTiles(const TiledCloud& cloud, const Eigen::Vector3d& origin);
  // Gives each cube to a tree, from the cubes and trees within 18 m of each tile (the reach of
  // three crowns). Then it measures one crown for each tree. `trees` in the order of task.stems.
  std::vector<TreeCrown> find(const CrownTask& task, TileShelf<std::uint64_t>& cubes,
                              const std::vector<OwnerTree>& trees);
  // Of one tile. Owners are indices of `trees`.
  [[nodiscard]] TreeOwners owners(std::size_t tile) const;
  [[nodiscard]] std::size_t size() const { return areas_.size(); }
  // The owner of a place (relative to the origin) by the owners of one tile: as TreeOwners::owner,
  // or kElsewhere where it counts for another tile.
  static constexpr std::int32_t kElsewhere = -2;
  [[nodiscard]] std::int32_t owner_in(std::size_t tile, const TreeOwners& owners,
                                      const Eigen::Vector2d& place, double height_m) const;
  // Whether a point (world frame) counts for a tile.
  [[nodiscard]] bool holds(std::size_t tile, const Eigen::Vector3d& point) const;

 private:
  std::vector<GroundArea> areas_;  // relative to the origin
  Eigen::Vector3d origin_;
  TileShelf<std::uint64_t> cubes_;
  TileShelf<std::int32_t> owners_;
};

}  // namespace understory
