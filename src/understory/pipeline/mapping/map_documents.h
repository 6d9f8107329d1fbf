#pragma once

#include "understory/pipeline/mapping/front_end.h"
#include "understory/pipeline/run_folder/run_documents.h"

namespace understory {

// run.json and report.html of a run of `understory map`, with what both front ends say alike:
// configuration, inputs, title, and how far it kept up with its sensors. `times` must outlive it.
[[nodiscard]] RunDocuments map_documents(const ReadRecording& recording, const StageTimes& times);

}  // namespace understory
