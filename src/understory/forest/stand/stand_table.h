#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include "understory/forest/stand/stand_figures.h"
#include "understory/geometry/plane/plot_shape.h"

namespace understory {

// A sample plot and its figures. `shape` is in the frame of the trees, `drawn` are the same rings
// in that of the layers.
struct StandPlot {
  PlotShape shape;
  StandFigures figures;
  std::vector<PlaneRing> drawn;
};

// The figures of a stand: of all that was seen, and of each plot.
struct StandTable {
  StandFigures seen;
  std::vector<StandPlot> plots;
  StandTableConfig config;
  std::optional<HeightCurve> curve;  // that heights were filled in with
  double form_factor = std::numeric_limits<double>::quiet_NaN();
  std::size_t without_diameter = 0;  // trees by their crowns alone: they do not count
};

}  // namespace understory
