#pragma once

#include "understory/evaluation/trajectory.h"
#include "understory/graph/self_correction/stem_correction.h"
#include "understory/output/report.h"
#include "understory/output/run_summary.h"
#include "understory/pipeline/correction/correction_run.h"

namespace understory {

// What report.html shows of a correction run, whose corrected path is `trajectory`. `run` must
// outlive the result.
[[nodiscard]] ReportInput correction_report(const StemCorrectionConfig& config,
                                            const CorrectionRun& run, const Trajectory& trajectory,
                                            const RunSummary& summary);

}  // namespace understory
