#pragma once

#include <vector>

#include "understory/geometry/pose.h"
#include "understory/output/run_summary.h"
#include "understory/pipeline/correction/correction_config.h"
#include "understory/pipeline/correction/correction_run.h"
#include "understory/util/log.h"

namespace understory {

// What run.json says of a run by stems: the summary of its reading, with the figures of the
// correction and the judgement of both.
[[nodiscard]] RunSummary correction_summary(const CorrectionConfig& config,
                                            const CorrectionRun& run, const Log& log);

// Length in metres of the way through poses.
[[nodiscard]] double length_through(const std::vector<Pose>& poses);

}  // namespace understory
