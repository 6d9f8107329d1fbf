#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "understory/forest/dead_wood/dead_wood.h"
#include "understory/forest/doubtful_trees.h"
#include "understory/forest/form/stem_curve.h"
#include "understory/forest/ground/ground.h"
#include "understory/forest/stand/seen_area.h"
#include "understory/forest/stand/stand_config.h"
#include "understory/forest/stems/beam_footprint.h"
#include "understory/forest/stems/stem_detector.h"
#include "understory/forest/tiles/crown_tiles.h"
#include "understory/forest/tiles/tiled_cloud.h"
#include "understory/forest/top_judgement.h"
#include "understory/forest/trees/canopy_crowns.h"
#include "understory/forest/trees/thin_coverage.h"
#include "understory/forest/trees/tree_owners.h"
#include "understory/forest/trees/tree_segments.h"
#include "understory/forest/trees/tree_sheets.h"
#include "understory/geometry/plane/plot_shape.h"
#include "understory/sensor/stem_view.h"
#include "understory/sensor/tree.h"
#include "understory/util/log.h"
#include "understory/util/progress.h"

namespace understory {

// How much an inventory measures: ground, stems, diameters and heights; or stem curves, volumes,
// crowns and the tree of each point as well.
enum class InventoryExtent { kBasic, kFull };

// The search for stems with the least diameter of 0, which stands for that of the extent.
[[nodiscard]] inline StemDetectorConfig least_diameter_by_extent() {
  StemDetectorConfig config;
  config.min_dbh_m = 0.0;
  return config;
}
// The same with the diameter that it stands for: 5 cm, and thinner stems down to 2 cm in a full
// inventory. So this has the trees of a basic one, and thinner ones.
[[nodiscard]] StemDetectorConfig search_of(StemDetectorConfig config, InventoryExtent extent);

// Settings of `understory inventory` and of the trees of a map.
struct InventoryConfig {
  InventoryExtent extent = InventoryExtent::kFull;
  GroundConfig ground;
  StemDetectorConfig stems = least_diameter_by_extent();
  BeamConfig beam;
  StemCurveConfig curves;
  CanopyCrownConfig crowns;  // of a full inventory
  DeadWoodConfig dead_wood;  // the same
  StandTableConfig stand;
  double canopy_cell_m = 0.5;
  int segments = 6;  // trees whose points are kept for a look at them
};
void describe(ConfigTable& table, InventoryConfig& config);
// The settings of an inventory at the end of `map`: no slower than it has to be.
[[nodiscard]] inline InventoryConfig basic_inventory() {
  InventoryConfig config;
  config.extent = InventoryExtent::kBasic;
  return config;
}

// What the cloud can tell about the stand. Expected outcomes (nothing found, too sparse) are told
// in `remarks`, in words for a forester.
struct InventoryResult {
  GroundModel ground;
  Raster canopy;  // highest point above ground per cell, NaN where none
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  // of slices and stems, world frame
  // By id, from 1: first those with a stem, in order of position, then those by their crowns alone.
  std::vector<Tree> trees;
  std::vector<StemFit> stems;        // of the same index as the first trees
  std::vector<StemCurve> curves;     // of the same index; of a full inventory only
  std::optional<TreeOwners> owners;  // of a full inventory: the trees' points
  // Of the same index as the stems, of a full inventory: each crown seen from above, world frame.
  // Empty where no crown was seen.
  std::vector<PlaneRing> crown_outlines;
  // Instead of the owners where the cloud lies in several tiles; not without the cloud.
  std::shared_ptr<OwnerTiles> owner_tiles;
  std::optional<CanopyCrowns> crowns;  // where trees were found by them
  // Of a full inventory, also where no tree stands: stumps, then lying stems. Nothing: not
  // searched.
  std::optional<std::vector<DeadWood>> dead_wood;
  std::vector<int> crown_ids;  // id of the tree of each crown, 0 where it is none of the list
  // The thinned points between 0.5 m and 3.5 m that were searched; of a cloud in several tiles some
  // of those near breast height.
  std::vector<SlicePoint> slices;
  std::vector<TreeSegment> segments;  // of a few trees, for the report
  std::vector<TreeSheet> sheets;      // of the stems that are most in doubt, by their number
  std::vector<LookAgain> look_again;  // places that would show weak stems, the best first
  ThinCoverage thin;                  // where stems may be missing, without the origin
  std::uint64_t points = 0;
  double area_m2 = 0.0;     // squares of 2 m that hold points
  VisibleArea seen;         // where stems could be seen; empty of a cloud from above and of a cut
  std::string two_images;   // why its scans do not lie on each other; empty: nothing says so
  bool too_sparse = false;  // for stems: some are missing from the list
  bool from_above = false;  // too sparse, as hardly any of its points lie near breast height
  bool open_land = false;   // too sparse, as hardly anything stands where the cloud is dense
  double range_noise_m = 0.0;  // along the beams, see range_noise_of; 0: none, or not known
  double blur_m = 0.0;         // of the cloud about its stems, see add_blurred_stems; 0: sharp
  std::vector<std::string> remarks;
};

// Ground, canopy, trees of a whole cloud: six runs through it. With `lookouts` trees that may go on
// above the view have no height, and tops that were hardly seen are lower bounds. `scanner`: where
// it was, metres, world frame. With it only what is in its sight counts as seen, and diameters are
// corrected for the width of its beams. Deterministic for any number of threads. Throws Stopped.
[[nodiscard]] InventoryResult take_inventory(const PointBlocks& cloud,
                                             const InventoryConfig& config,
                                             const ProgressSink& progress = {},
                                             const Lookouts& lookouts = {},
                                             const std::vector<Eigen::Vector3d>& scanner = {});
// The same of a cloud in tiles, in the memory that one of them needs: the same trees whatever the
// tiles are.
[[nodiscard]] InventoryResult take_inventory(const TiledCloud& cloud, const InventoryConfig& config,
                                             const ProgressSink& progress = {},
                                             const Lookouts& lookouts = {},
                                             const std::vector<Eigen::Vector3d>& scanner = {});

// The id of the tree that a point of the cloud belongs to, 0 if none; of a full inventory.
// `height_m` is its height above the ground.
[[nodiscard]] std::uint32_t tree_at(const InventoryResult& inventory, const Eigen::Vector3d& point,
                                    double height_m);
// The same for a point of a tile with these owners.
[[nodiscard]] std::uint32_t tree_at(const InventoryResult& inventory, const TreeOwners& owners,
                                    const Eigen::Vector3d& point, double height_m);

// The stems of an inventory as one view of them: foot and centre line, in metres in the world
// frame. `origin` (metres, world frame) is taken away, so that single precision is enough. In the
// order of the trees.
[[nodiscard]] std::vector<Stem> stems_of(const InventoryResult& inventory,
                                         const Eigen::Vector3d& origin);

}  // namespace understory
