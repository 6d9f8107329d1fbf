#pragma once

#include "understory/cli/command.h"

namespace understory {

// `understory evaluate map RUN` (a cloud) and `understory evaluate map STEMS TRAJECTORY`
void add_evaluate_map_command(CLI::App& evaluate, Command& chosen);

}  // namespace understory
