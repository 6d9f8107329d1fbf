#pragma once

#include <vector>

#include "understory/geometry/pose.h"
#include "understory/pipeline/correction/correction_config.h"
#include "understory/pipeline/correction/correction_run.h"
#include "understory/pipeline/run_folder/run_documents.h"

namespace understory {

// Adds what run.json says of a run by stems: the figures of the correction, and the judgement of it
// and of the reading.
void summarise_correction(const CorrectionConfig& config, const CorrectionRun& run,
                          RunDocuments& documents);

// Length in metres of the way through poses.
[[nodiscard]] double length_through(const std::vector<Pose>& poses);

}  // namespace understory
