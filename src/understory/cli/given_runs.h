#pragma once

#include <CLI/CLI.hpp>

#include "understory/util/log.h"

namespace understory {

// Checks each run among the paths that were given, but for outputs: whether this version reads it,
// and whether it is finished (pipeline/run_folder/run_version.h). Throws InputError.
void check_given_runs(const CLI::App& app, Log& log);

}  // namespace understory
