#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string_view>
#include <vector>

#include "understory/forest/ground_area.h"
#include "understory/forest/slice/slice_thinner.h"
#include "understory/forest/stems/stem_detector.h"
#include "understory/forest/tiles/tile_shelf.h"
#include "understory/forest/tiles/tiled_cloud.h"
#include "understory/geometry/raster.h"
#include "understory/util/config/config.h"
#include "understory/util/progress.h"

namespace understory {

// Wood that no longer grows and lies below breast height: what a full inventory looks for.
struct DeadWoodConfig {
  double min_diameter_m = 0.1;  // thinner pieces are not listed
};
void describe(ConfigTable& table, DeadWoodConfig& config);

// A stump stands and ends in a cut below breast height; a log is a lying stem.
enum class DeadWoodKind { kStump, kLog };
// "stump" or "log", as in dead_wood.csv.
[[nodiscard]] std::string_view dead_wood_name(DeadWoodKind kind);

// A stump or a lying stem, along its centre line. World frame, metres.
struct DeadWood {
  DeadWoodKind kind = DeadWoodKind::kLog;
  Eigen::Vector3d from = Eigen::Vector3d::Zero();  // foot of a stump, thick end of a log
  Eigen::Vector3d to = Eigen::Vector3d::Zero();    // its other end
  double diameter_m = 0.0;                         // at `from`
  double diameter_to_m = 0.0;
  double diameter_sd_m = 0.0;  // of the diameter in the middle
  int observations = 0;        // returns of the cloud
  [[nodiscard]] double length_m() const { return (to - from).norm(); }
  // Of the frustum between both ends, m3.
  [[nodiscard]] double volume_m3() const;
};

// The points of a cloud in which dead wood is looked for, one for each small cube. Their heights
// are above the terrain.
class LowPoints {
 public:
  LowPoints();
  // Frame of the search: metres relative to its origin.
  void add(const Eigen::Vector2d& place, double height_m);
  // Whether a height is one of those looked at.
  [[nodiscard]] static bool holds(double height_m);
  // The lower corner of the cube that holds a place.
  [[nodiscard]] Eigen::Vector2d corner_of(const Eigen::Vector2d& place) const;
  [[nodiscard]] std::vector<SlicePoint> take();

 private:
  SliceThinner thinner_;
};

// What the search looks at.
struct DeadWoodTask {
  const TiledCloud& cloud;
  const Raster& ground;  // terrain
  Eigen::Vector3d origin;
  const std::vector<StemFit>& stems;  // of living trees and snags, relative to the origin
  const DeadWoodConfig& config;
  const ProgressSink& progress;
};

// Stumps, then logs, each by x, then y of their middle: the same whatever the tiles are. `low`: of
// each tile, what LowPoints made of the cubes that begin in it.
[[nodiscard]] std::vector<DeadWood> find_dead_wood(const DeadWoodTask& task,
                                                   const TileShelf<SlicePoint>& low);

}  // namespace understory
