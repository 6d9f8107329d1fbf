#pragma once

#include <filesystem>

#include "understory/pipeline/mapping/mapping_request.h"
#include "understory/pipeline/mapping/run_state.h"
#include "understory/pipeline/run_folder/run_outcome.h"
#include "understory/util/log.h"
#include "understory/util/progress.h"

namespace understory {

// A run of `understory map` by either front end, at its beginning or where it was cut off. It holds
// the run folder.
struct MappingRun {
  MappingRequest request;
  RunState state;
};

// Claims the run folder and leaves what is in it as it is. Throws InputError where a file that the
// configuration names cannot be used, OutputError as RunFolder::claim.
[[nodiscard]] MappingRun begin_mapping(MappingRequest request);
// That of a killed or stopped run: it gives the same files as an undisturbed one. Throws InputError
// where there is nothing to go on with.
[[nodiscard]] MappingRun reopen_mapping(const std::filesystem::path& run_folder);

// From a raw recording to the run folder: the main job, and the function to read first. Throws
// InputError or OutputError where nothing usable can be made, and Stopped where the user stops it
// once the recording is read. What a killed run leaves behind is finished by way of
// `reopen_mapping`.
[[nodiscard]] RunOutcome run_mapping(MappingRun run, Log& log, const ProgressSink& progress,
                                     const StopRequested& stop_requested);

}  // namespace understory
