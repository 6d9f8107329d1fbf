#pragma once

#include <string>

#include "understory/cli/command.h"
#include "understory/recording/recording.h"

namespace understory {

// Whether an output is a table of stems: its name ends in .csv.gz.
[[nodiscard]] bool is_stems_file(const std::string& output);

// Writes the stems of each scan of a recording, as seen from where the body was (the motion within
// a scan is not taken out), or those of a cloud (.las, .laz, .ply, .pcd) that is a map. Returns the
// exit code. Throws InputError where there is none.
[[nodiscard]] int convert_to_stems(const std::string& input, const std::string& output,
                                   const OpenOptions& open, CommandContext& context);

}  // namespace understory
