#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "understory/features/tree_tops.h"
#include "understory/geometry/raster.h"
#include "understory/util/config/config.h"

namespace understory {

// Which trees are found by their crowns alone, without a stem.
enum class CrownSearch {
  kNever,
  kFromAbove,  // all of a cloud that was taken from above: it shows crowns and hardly any stem
  kAlways,     // also those of other clouds whose crown holds no stem of the list
};

// How crowns are found in a raster of canopy heights.
struct CanopyCrownConfig {
  CrownSearch search = CrownSearch::kFromAbove;
  CanopyTopConfig tops;
  double lowest_share = 0.45;  // of the top's height: what is lower is no part of the crown
};
void describe(ConfigTable& table, CanopyCrownConfig& config);

// A tree by its crown. Frame of the raster.
struct CanopyCrown {
  Eigen::Vector2d top = Eigen::Vector2d::Zero();  // metres
  double height_m = 0.0;                          // of the top above the ground
  double area_m2 = 0.0;                           // of its cells
  bool cut = false;  // the top lies at the border of the canopy: the highest point may be beyond
};

// Crowns of a canopy and the crown of each of its cells.
struct CanopyCrowns {
  static constexpr std::int32_t kNone = -1;
  std::vector<CanopyCrown> crowns;  // by the row of their tops from the south, then from the west
  Raster canopy;                    // small gaps and pits filled, metres above the ground
  std::vector<std::int32_t> owner;  // index into `crowns` of each cell of `canopy`, or kNone

  // The crown of the cell that holds a place, kNone where there is none.
  [[nodiscard]] std::int32_t at(const Eigen::Vector2d& place) const;
};

// Tops of a raster of canopy heights (metres above the ground, NaN where nothing is known), and the
// cells of each. The method is a watershed that begins at the tops (F. Meyer, Signal Processing
// 38(1):113-125, 1994). A crown reaches down to a share of its height, and as far from its top as
// the crown of a tree can (see TreeOwners). Deterministic.
[[nodiscard]] CanopyCrowns find_canopy_crowns(const Raster& canopy,
                                              const CanopyCrownConfig& config);

}  // namespace understory
