#pragma once

#include "understory/evaluation/trajectory.h"
#include "understory/output/report.h"
#include "understory/output/run_summary.h"
#include "understory/pipeline/correction/correction_run.h"
#include "understory/pipeline/correction/stem_correction.h"

namespace understory {

// What report.html shows of a correction run, whose corrected path is `trajectory`. `run` must
// outlive the result.
[[nodiscard]] ReportInput correction_report(const StemCorrectionConfig& config,
                                            const CorrectionRun& run, const Trajectory& trajectory,
                                            const RunSummary& summary);

}  // namespace understory
