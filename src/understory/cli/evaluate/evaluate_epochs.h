#pragma once

#include "understory/cli/command.h"
#include "understory/cli/evaluate/evaluate_trees_text.h"

namespace understory {

// `evaluate trees OLD NEW --epochs`: what became of the trees between two lists of one stand.
// Prints it, writes the file of `options.output`, returns the exit code. Throws InputError and
// OutputError.
[[nodiscard]] int evaluate_epochs(const TreeOptions& options, CommandContext& context);

}  // namespace understory
