#pragma once

#include "understory/cli/command.h"
#include "understory/pipeline/mapping.h"

namespace understory {

// Prints what a mapping run came to on stdout; returns its exit code.
[[nodiscard]] int report_outcome(const MappingOutcome& outcome);

// The options that say how a recording is to be read.
void add_open_options(CLI::App& command, OpenOptions& options);

}  // namespace understory
