#include "understory/cli/plot_options.h"

#include <optional>

#include "understory/util/error.h"
#include "understory/util/files/csv.h"

namespace understory {

void add_plot_options(CLI::App& command, PlotOptions& options) {
  // An empty variable of a script is no wish for a list without plots.
  const auto given = [](const std::string& text) {
    return trimmed(text).empty() ? std::string("expected a value, found an empty text")
                                 : std::string();
  };
  command
      .add_option("--plots", options.plots,
                  "Sample plots that get figures of their own, in the coordinates of trees.gpkg. "
                  "X,Y,R (one circle), a .csv with id,x,y,radius_m, or a GeoPackage with polygons "
                  "or with points and radius_m")
      ->check(given);
  command
      .add_option("--plot-grid", options.grid_m,
                  "Figures by grid cells of this side, metres (1 to 1000)")
      ->check(given);
}

std::vector<std::string> plot_settings(const PlotOptions& options, const std::string& prefix) {
  std::vector<std::string> settings;
  constexpr double kSmallestCell = 1.0;  // m: smaller ones hold parts of a stem
  const std::optional<double> side_m = to_number(options.grid_m);
  if (side_m && *side_m >= 0.0 && *side_m < kSmallestCell)
    throw ConfigError({"--plot-grid: expected cells of 1 to 1000 m, not of " + options.grid_m});
  if (!options.plots.empty()) settings.push_back(prefix + "plots=" + options.plots);
  if (!options.grid_m.empty()) settings.push_back(prefix + "grid_m=" + options.grid_m);
  return settings;
}

}  // namespace understory
