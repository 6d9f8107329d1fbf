#pragma once

#include "understory/cli/command.h"
#include "understory/cli/open_options.h"
#include "understory/pipeline/mapping.h"

namespace understory {

// Prints what a mapping run came to on stdout; returns its exit code.
[[nodiscard]] int report_outcome(const MappingOutcome& outcome);

}  // namespace understory
