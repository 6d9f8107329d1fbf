#pragma once

#include "understory/pipeline/judgement/run_evidence.h"
#include "understory/pipeline/mapping/run_facts.h"
#include "understory/pipeline/mapping/sparse/sparse_front_end.h"
#include "understory/recording/recording.h"
#include "understory/util/log.h"

namespace understory {

// What the sparse front end and the reading of its recording say about the map, the figures of the
// path included.
void gather_sparse(const SparseFrontEnd& front_end, const RunFacts& facts, const Recording& source,
                   const Log& log, RunEvidence& evidence);

}  // namespace understory
