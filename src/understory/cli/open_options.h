#pragma once

#include <CLI/CLI.hpp>

#include "understory/recording/recording.h"

namespace understory {

// The options that say how a recording is to be read.
void add_open_options(CLI::App& command, OpenOptions& options);

}  // namespace understory
