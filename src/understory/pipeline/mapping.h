#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "understory/output/run_summary.h"
#include "understory/pipeline/mapping_config.h"
#include "understory/recording/recording.h"
#include "understory/util/log.h"
#include "understory/util/progress.h"

namespace understory {

// One call of `understory map`.
struct MappingRequest {
  std::string recording;  // file, folder or sim:SITE
  std::filesystem::path run_folder;
  MappingConfig config;
  std::string config_yaml;  // resolved, every key, for run.json and for resuming
  OpenOptions open;
  bool realtime = false;
  bool overwrite = false;  // start anew although the folder holds an unfinished run
};

struct MappingOutcome {
  RunStatus status = RunStatus::kComplete;
  std::vector<std::string> reasons;  // why partial or untrusted
  std::filesystem::path report;
  std::string summary;  // a few lines for the terminal
};

// From a raw recording to the run folder: the main job, and the function to read first.
// Throws InputError or OutputError where nothing usable can be made; what a killed run leaves
// behind is finished by `resume_mapping`.
[[nodiscard]] MappingOutcome run_mapping(const MappingRequest& request, Log& log,
                                         const ProgressSink& progress,
                                         const StopRequested& stop_requested);

// Goes on where a killed run stopped. Gives the same files as an undisturbed run.
[[nodiscard]] MappingOutcome resume_mapping(const std::filesystem::path& run_folder, Log& log,
                                            const ProgressSink& progress,
                                            const StopRequested& stop_requested);

}  // namespace understory
