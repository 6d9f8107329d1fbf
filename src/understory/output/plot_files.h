#pragma once

#include <filesystem>
#include <vector>

#include "understory/forest/stand/stand_table.h"

namespace understory {

// One column of plots.csv and of the layer `plots` beside the plot's name and kind. Its cell is
// empty where the value is NaN. docs/reference/outputs.md explains each to the user.
struct PlotColumn {
  const char* name;
  double (*value)(const StandPlot& plot);
  int decimals;
};
[[nodiscard]] const std::vector<PlotColumn>& plot_columns();

// Writes plots.csv, whose first row `seen` is all that was seen, and plot_classes.csv with the
// trees of each class of diameters. Throws OutputError.
void write_plot_tables(const std::filesystem::path& folder, const StandTable& stand);

}  // namespace understory
