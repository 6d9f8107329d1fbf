#pragma once

#include <filesystem>

#include "understory/util/log.h"

namespace understory {

// What a command asks of each path that it is to read, before it reads there. `given` is a run
// folder, or a file that a run lists in its run.json; it passes over anything else. Throws
// InputError where the run
//   - has a newer format than this program reads, in run.json or in its work folder,
//   - is not finished and has no results yet: the error names the command that finishes it.
// Warns (key "run.newer_version") where a newer version of the program wrote it in this format.
void check_given_run(const std::filesystem::path& given, Log& log);

}  // namespace understory
