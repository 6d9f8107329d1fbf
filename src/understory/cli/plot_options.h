#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace understory {

// Sample plots of `inventory` and `map`.
struct PlotOptions {
  std::string plots;
  std::string grid_m;
};

// --plots and --plot-grid.
void add_plot_options(CLI::App& command, PlotOptions& options);

// What they mean as settings below `prefix`; none where they were not given.
[[nodiscard]] std::vector<std::string> plot_settings(const PlotOptions& options,
                                                     const std::string& prefix);

}  // namespace understory
