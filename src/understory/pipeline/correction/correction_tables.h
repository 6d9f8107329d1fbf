#pragma once

#include "understory/pipeline/correction/correction_files.h"

namespace understory {

// What a run by stems tells of its path and how it was found: odometry.tum, trajectory.tum,
// steps.csv, loops.csv, corrections.csv. Throws OutputError.
void write_correction_tables(const CorrectionRequest& request, const CorrectionRun& run);

}  // namespace understory
