#pragma once

#include "understory/pipeline/judgement/run_evidence.h"
#include "understory/pipeline/mapping/dense/dense_front_end.h"
#include "understory/pipeline/mapping/run_facts.h"
#include "understory/recording/recording.h"
#include "understory/util/log.h"

namespace understory {

// What the dense front end and the reading of its recording say about the map. `evidence.motion`
// and the finished path's figures in `evidence.match` are there already.
void gather_dense(const DenseFrontEnd& front_end, const RunFacts& facts, const Recording& source,
                  const Log& log, RunEvidence& evidence);

}  // namespace understory
