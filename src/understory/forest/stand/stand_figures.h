#pragma once

#include <cstddef>
#include <vector>

#include "understory/forest/stand/seen_area.h"
#include "understory/forest/stand/stand_trees.h"
#include "understory/geometry/plane/plot_shape.h"

namespace understory {

// Trees with a diameter from `from_m` up to `to_m`.
struct DiameterClass {
  double from_m = 0.0;
  double to_m = 0.0;
  std::size_t trees = 0;
  Measured stems_per_ha;
  Measured basal_area_m2_per_ha;
};

// The figures of a sample plot. A figure is NaN where it is not known. Standard deviations are
// those of the errors of measurement: the figures of the same plot without any error are the truth.
// They do not say how far the plot is from its stand.
struct StandFigures {
  double area_m2 = 0.0;     // of the plot on the map
  double seen_m2 = 0.0;     // what was seen of it
  double seen_share = 0.0;  // the latter over the former
  std::size_t trees = 0;    // that count
  std::size_t heights_filled_in = 0;
  // Trees whose lower bound counts as their height: then heights and volumes are lower bounds.
  std::size_t heights_lower_bounds = 0;
  std::size_t volumes_filled_in = 0;
  Measured stems_per_ha;
  Measured basal_area_m2_per_ha;
  Measured mean_dbh_m;          // quadratic: the diameter of the mean basal area
  Measured weighted_dbh_m;      // weighted by basal area
  Measured weighted_height_m;   // Lorey's: weighted by basal area
  Measured dominant_height_m;   // mean of the 100 thickest per hectare
  double dominant_trees = 0.0;  // how many these are on the plot; the last one may count in part
  Measured volume_m3_per_ha;    // by the stem curves
  Measured national_m3_per_ha;  // by the national function, of a known species
  std::vector<DiameterClass> classes;  // from the class of `min_dbh_m` to that of the thickest
};

// What a plot's figures rest on beside its trees.
struct FiguresConfig {
  double class_m = 0.02;
  double min_dbh_m = 0.05;
  double least_seen = 0.5;    // a plot of which less was seen has no figures by hectare
  double missed_share = 0.0;  // of the trees within the area that was seen
};

// The denominator is what was seen of the plot, and what was not seen is taken to be like it. The
// square of a diameter is less the square of its standard deviation, as a noisy diameter is too
// large in the square. Standard deviations hold the errors of diameters, heights and volumes, and
// the trees at the border whose place is not certain. They also hold the trees that were missed,
// and the area that was not seen. `plot`: in the frame of the trees; without rings it is everything
// that was seen.
[[nodiscard]] StandFigures stand_figures(const StandTrees& stand, const VisibleArea& seen,
                                         const PlotShape& plot, const FiguresConfig& config);

}  // namespace understory
