#pragma once

#include "understory/evaluation/world_frame.h"
#include "understory/util/config/config.h"

namespace understory {

// How `map` writes its files.
struct OutputConfig {
  WorldFrame world_frame = WorldFrame::kEnu;  // of the text files with world coordinates
};
void describe(ConfigTable& table, OutputConfig& config);

}  // namespace understory
