#pragma once

#include "understory/evaluation/trajectory.h"
#include "understory/graph/self_correction/stem_correction.h"
#include "understory/pipeline/correction/correction_run.h"
#include "understory/pipeline/run_folder/run_documents.h"

namespace understory {

// Adds what report.html shows of a correction run, whose corrected path is `trajectory`. `run` must
// outlive `documents`.
void report_correction(const StemCorrectionConfig& config, const CorrectionRun& run,
                       const Trajectory& trajectory, RunDocuments& documents);

}  // namespace understory
