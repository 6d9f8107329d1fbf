#pragma once

#include <filesystem>
#include <string>

#include "understory/pipeline/correction.h"
#include "understory/pipeline/sparse_mapping_config.h"
#include "understory/recording/recording.h"

namespace understory {

// One call of `understory map --front-end sparse`.
struct SparseMappingRequest {
  std::string recording;  // file, folder or sim:SITE
  std::filesystem::path run_folder;
  SparseMappingConfig config;
  std::string config_yaml;
  OpenOptions open;
  bool realtime = false;  // played at the speed of its sensors; late scans are dropped
  bool overwrite = false;
};

// From a raw recording to the run folder by stems alone: the stems of each scan, odometry from
// them, stems.csv.gz with the views that were kept, and the correction of what they show
// (run_correction). Only stems and poses are held in memory. Throws InputError or OutputError.
[[nodiscard]] CorrectionOutcome run_sparse_mapping(const SparseMappingRequest& request, Log& log,
                                                   const ProgressSink& progress,
                                                   const StopRequested& stop_requested);

}  // namespace understory
