#pragma once

#include "understory/pipeline/correction/correction_run.h"
#include "understory/pipeline/judgement/run_evidence.h"

namespace understory {

// What the judgement of a run by stems rests on: what is known of the reading, and how views, loops
// and trees turned out.
[[nodiscard]] RunEvidence correction_evidence(const CorrectionRun& run);

}  // namespace understory
