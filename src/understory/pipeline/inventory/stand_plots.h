#pragma once

#include <string>
#include <vector>

#include "understory/forest/inventory.h"
#include "understory/forest/stand/stand_table.h"
#include "understory/georeference/plot_file.h"
#include "understory/georeference/systems/layer_frame.h"

namespace understory {

// The figures of a stand, and what a user has to know of them.
struct StandResult {
  StandTable table;
  std::vector<std::string> remarks;
  // Why plots have no figures; empty: all have.
  std::string complaint;
  // Where stems were seen, in words, in the frame of the layers.
  std::string seen_at;
};

// The outlines that `config.plots` names, in the coordinates of `system`; none where it names none.
// Throws as read_plots.
[[nodiscard]] std::vector<PlotOutline> plots_of(const StandTableConfig& config,
                                                const std::string& system);

// Throws InputError where every plot lies outside of the box of a cloud: `low` and `high` are in
// the frame of the plots.
void refuse_plots_outside(const StandTableConfig& config, const std::vector<PlotOutline>& plots,
                          const Eigen::Vector2d& low, const Eigen::Vector2d& high);

// Whether plots or grid cells are asked for.
[[nodiscard]] inline bool asks_for_plots(const StandTableConfig& config) {
  return !config.plots.empty() || config.grid_m > 0.0;
}

// Figures of all that was seen, of each plot and of each grid cell of which anything was seen.
// `plots`: in the frame of the layers, as the cells are where its unit is the metre. The inventory
// is in the world frame.
[[nodiscard]] StandResult take_stand(const InventoryResult& inventory,
                                     const StandTableConfig& config,
                                     const std::vector<PlotOutline>& plots,
                                     const LayerFrame& layers);

}  // namespace understory
