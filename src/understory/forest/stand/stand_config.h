#pragma once

#include <string>

#include "understory/forest/form/taper_form.h"
#include "understory/util/config/config.h"

namespace understory {

// Along what the radius of a circular plot was measured: the map, or the ground.
enum class PlotRadius { kHorizontal, kSlope };

// Settings of the stand's figures.
struct StandTableConfig {
  std::string plots;    // "X,Y,R", or a file with plots; empty: none
  double grid_m = 0.0;  // side of grid cells with figures of their own; 0: none
  PlotRadius radius = PlotRadius::kHorizontal;
  double min_dbh_m = 0.05;     // thinner trees do not count
  double class_m = 0.02;       // width of a class of diameters
  double reach_m = 15.0;       // from the path, where there is one
  double least_seen = 0.5;     // share of a plot that gives figures
  double missed_share = 0.01;  // of the trees where stems could be seen; for deviations alone
  TaperSpecies species = TaperSpecies::kUnknown;
};
void describe(ConfigTable& table, StandTableConfig& config);

}  // namespace understory
