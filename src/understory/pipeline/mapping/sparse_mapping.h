#pragma once

#include <filesystem>

#include "understory/pipeline/correction/correction.h"
#include "understory/pipeline/mapping/sparse_mapping_config.h"
#include "understory/pipeline/run_request.h"

namespace understory {

// One call of `understory map --front-end sparse`.
struct SparseMappingRequest : RunRequest {
  SparseMappingConfig config;
};

struct UnfinishedRun;  // pipeline/mapping/run_state.h

// From a raw recording to the run folder by stems alone: the stems of each scan, odometry from
// them, stems.csv.gz with the views that were kept, and the correction of what they show
// (run_correction). Only stems and poses are held in memory. Throws InputError or OutputError; what
// a killed run leaves behind is finished by `resume_sparse_mapping`.
[[nodiscard]] CorrectionOutcome run_sparse_mapping(const SparseMappingRequest& request, Log& log,
                                                   const ProgressSink& progress,
                                                   const StopRequested& stop_requested);

// Goes on where a killed run stopped. Gives the same files as an undisturbed run.
[[nodiscard]] CorrectionOutcome resume_sparse_mapping(UnfinishedRun run, Log& log,
                                                      const ProgressSink& progress,
                                                      const StopRequested& stop_requested);

}  // namespace understory
