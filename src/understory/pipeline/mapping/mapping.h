#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "understory/output/run_summary.h"
#include "understory/pipeline/mapping/mapping_config.h"
#include "understory/pipeline/run_request.h"
#include "understory/util/log.h"
#include "understory/util/progress.h"

namespace understory {

// One call of `understory map`.
struct MappingRequest : RunRequest {
  MappingConfig config;
};

struct MappingOutcome {
  RunStatus status = RunStatus::kComplete;
  std::vector<std::string> reasons;  // why partial or untrusted
  std::filesystem::path report;
  std::string summary;  // a few lines for the terminal
};

struct UnfinishedRun;  // pipeline/mapping/run_state.h

// From a raw recording to the run folder: the main job, and the function to read first.
// Throws InputError or OutputError where nothing usable can be made; what a killed run leaves
// behind is finished by `resume_mapping`.
[[nodiscard]] MappingOutcome run_mapping(const MappingRequest& request, Log& log,
                                         const ProgressSink& progress,
                                         const StopRequested& stop_requested);

// Goes on where a killed run stopped. Gives the same files as an undisturbed run.
[[nodiscard]] MappingOutcome resume_mapping(UnfinishedRun run, Log& log,
                                            const ProgressSink& progress,
                                            const StopRequested& stop_requested);

}  // namespace understory
