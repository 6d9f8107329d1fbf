#pragma once

#include "understory/cli/command.h"

namespace understory {

// `understory evaluate trees A B`
void add_evaluate_trees_command(CLI::App& evaluate, Command& chosen);

}  // namespace understory
