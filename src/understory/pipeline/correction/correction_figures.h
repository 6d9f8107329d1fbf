#pragma once

#include "understory/output/report/report.h"
#include "understory/pipeline/correction/correction_run.h"

namespace understory {

// What the report draws of a correction: pairs of views by overlap and error (P0 figures 9 and 10,
// P1 figure 5). Also sights before and after (P0 figure 11). Also trees over the distance from the
// way (P1 figure 8 d). Deterministic; the same for any number of threads.
void add_correction_figures(const CorrectionRun& run, const StemCorrectionConfig& config,
                            const std::vector<Tree>& trees, ReportCorrection& report);

}  // namespace understory
