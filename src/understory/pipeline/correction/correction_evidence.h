#pragma once

#include <cstddef>

#include "understory/pipeline/correction/correction_files.h"
#include "understory/pipeline/judgement/run_evidence.h"
#include "understory/util/log.h"

namespace understory {

// What the judgement of a run by stems rests on, `trees` of which were listed. Where the stems come
// from a recording that was just read, what is known of its sensors is part of it.
[[nodiscard]] RunEvidence evidence_of(const CorrectionRequest& request, const CorrectionRun& run,
                                      std::size_t trees, const Log& log);

}  // namespace understory
