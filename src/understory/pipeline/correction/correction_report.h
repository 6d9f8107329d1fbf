#pragma once

#include <vector>

#include "understory/forest/tree.h"
#include "understory/output/report.h"
#include "understory/pipeline/correction/correction_files.h"

namespace understory {

// What report.html shows of a correction run. `trees` must outlive the result.
[[nodiscard]] ReportInput correction_report(const CorrectionRequest& request,
                                            const CorrectionRun& run, const RunSummary& summary,
                                            const std::vector<Tree>& trees);

}  // namespace understory
