#pragma once

#include <memory>
#include <string>

#include "understory/recording/recording.h"

namespace understory {

// Opens what a user may name as a recording: a file or folder, or "sim:SITE?seed=N&key=value" for
// the simulator as a live source.
[[nodiscard]] std::unique_ptr<Recording> open_source(const std::string& name,
                                                     const OpenOptions& options, Log& log);

// Whether `name` is a simulated recording.
[[nodiscard]] bool is_simulation(const std::string& name);

}  // namespace understory
