#include "understory/pipeline/run_folder/output_config.h"

namespace understory {

void describe(ConfigTable& table, OutputConfig& config) {
  table.add_enum("world_frame", config.world_frame,
                 {{"enu", WorldFrame::kEnu}, {"ned", WorldFrame::kNed}},
                 "axes of paths, states, graph, fixes and trees as text: east, north, up, or "
                 "north, east, down; clouds and rasters stay");
}

}  // namespace understory
