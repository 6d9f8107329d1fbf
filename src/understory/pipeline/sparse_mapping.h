#pragma once

#include <filesystem>
#include <string>

#include "understory/odometry/stem_front_end.h"
#include "understory/odometry/stem_pacer.h"
#include "understory/pipeline/correction.h"
#include "understory/preprocess/event_orderer.h"
#include "understory/recording/recording.h"

namespace understory {

struct SparseMappingConfig {
  EventOrderer::Config time_repair;
  StemFrontEndConfig front_end;
  StemPaceConfig pace;
  CorrectionConfig correction;
};
[[nodiscard]] ConfigTable sparse_mapping_table(SparseMappingConfig& config);

// One call of `understory map --front-end sparse`.
struct SparseMappingRequest {
  std::string recording;  // file, folder or sim:SITE
  std::filesystem::path run_folder;
  SparseMappingConfig config;
  std::string config_yaml;
  OpenOptions open;
  bool overwrite = false;
};

// From a raw recording to the run folder by stems alone: the stems of each scan, odometry from
// them, stems.csv.gz with the views that were kept, and the correction of what they show
// (run_correction). Only stems and poses are held in memory. Throws InputError or OutputError.
[[nodiscard]] CorrectionOutcome run_sparse_mapping(const SparseMappingRequest& request, Log& log,
                                                   const ProgressSink& progress,
                                                   const StopRequested& stop_requested);

}  // namespace understory
