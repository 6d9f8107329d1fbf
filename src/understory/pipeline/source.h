#pragma once

#include <memory>
#include <string>
#include <vector>

#include "understory/output/run_summary.h"
#include "understory/recording/recording.h"

namespace understory {

// Opens what a user may name as a recording: a file or folder, or "sim:SITE?seed=N&key=value" for
// the simulator as a live source.
[[nodiscard]] std::unique_ptr<Recording> open_source(const std::string& name,
                                                     const OpenOptions& options, Log& log);

// Whether `name` is a simulated recording.
[[nodiscard]] bool is_simulation(const std::string& name);

// Hashes of the recording's files; none for the simulator. Throws InputError.
[[nodiscard]] std::vector<InputHash> hash_inputs(const std::string& recording);

}  // namespace understory
