#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include "understory/forest/stand/height_curve.h"
#include "understory/forest/stand/stand_config.h"
#include "understory/sensor/tree.h"

namespace understory {

// A value with its standard deviation; NaN where unknown.
struct Measured {
  double value = std::numeric_limits<double>::quiet_NaN();
  double sd = 0.0;
};

// A tree as it counts for the figures of a stand, frame of the stand. What was not measured is
// filled in here, and nowhere else.
struct StandTree {
  Eigen::Vector2d place = Eigen::Vector2d::Zero();
  double place_sd_m = 0.0;  // in any one direction
  Measured dbh_m;
  Measured height_m;
  bool height_filled_in = false;       // by the height curve
  double height_shared_sd_m = 0.0;     // error of the curve itself, which all these trees share
  bool height_is_lower_bound = false;  // there is no curve
  Measured volume_m3;
  bool volume_filled_in = false;  // by the form factor of the other trees
  Measured national_volume_m3;    // of a known species
};

// The trees that count, and how the gaps among their values were filled.
struct StandTrees {
  std::vector<StandTree> trees;  // of `min_dbh_m` and more
  TaperSpecies species = TaperSpecies::kUnknown;
  std::size_t without_diameter = 0;
  std::optional<HeightCurve> curve;
  double form_factor = std::numeric_limits<double>::quiet_NaN();
};

// A height that was not seen is that of the height curve. A lower bound, or a height too far below
// the curve to be one, becomes the height expected above it by the curve. Without a curve the bound
// itself counts, and the volume up to it: figures of such trees are lower bounds. A stem without a
// volume has basal area times height times the form factor: the sum of the known volumes over that
// of the products. Where neither is known, the value stays NaN.
[[nodiscard]] StandTrees stand_trees(const std::vector<Tree>& trees,
                                     const StandTableConfig& config);

}  // namespace understory
