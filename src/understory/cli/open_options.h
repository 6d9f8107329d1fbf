#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "understory/recording/recording.h"

namespace understory {

// The options that say how a recording is to be read.
void add_open_options(CLI::App& command, OpenOptions& options);

// RefusedOutput if a run folder is, lies in or holds what the run reads: the recording, what
// opening it reads, and `more`.
void refuse_run_over_inputs(const std::filesystem::path& run_folder, const std::string& recording,
                            const OpenOptions& options, const std::vector<std::string>& more);

}  // namespace understory
