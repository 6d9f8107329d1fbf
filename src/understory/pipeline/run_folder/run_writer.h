#pragma once

#include "understory/pipeline/mapping/dense_front_end.h"
#include "understory/pipeline/mapping/front_end.h"
#include "understory/pipeline/run_folder/run_outcome.h"

namespace understory {

// Writes what the dense front end has found: trajectory, states, keyframes, graph, fixes, map,
// trees, terrain, run.json, report.
[[nodiscard]] RunOutcome write_run(const ReadRecording& recording, DenseFrontEnd& session);

}  // namespace understory
