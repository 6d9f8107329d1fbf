#pragma once

#include <filesystem>
#include <string>

#include "understory/odometry/stems/sparse_odometry.h"
#include "understory/pipeline/correction/correction_config.h"
#include "understory/pipeline/run_folder/run_outcome.h"
#include "understory/util/config/config_origins.h"
#include "understory/util/log.h"
#include "understory/util/progress.h"

namespace understory {

// One call of `understory correct`.
struct CorrectionRequest {
  // stems.csv.gz, or a run folder that holds one. The correction of a run folder begins with its
  // trajectory.tum, and its results have a row for each pose of it.
  std::filesystem::path stems;
  std::filesystem::path run_folder;
  bool overwrite = false;         // what an earlier run left in the folder, finished or not
  SparseOdometryConfig odometry;  // of views that have no trajectory yet
  CorrectionConfig config;
  ConfigRecord config_record;  // for run.json
};

// From the stems of a recording to the run folder: odometry, loops, trajectory, tree map.
// Throws InputError or OutputError, and Stopped where the user stops it once the views are
// positioned: the folder is as it was.
[[nodiscard]] RunOutcome run_correction(const CorrectionRequest& request, Log& log,
                                        const ProgressSink& progress,
                                        const StopRequested& stop_requested);

}  // namespace understory
