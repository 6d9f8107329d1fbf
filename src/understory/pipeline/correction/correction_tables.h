#pragma once

#include <filesystem>

#include "understory/evaluation/trajectory.h"
#include "understory/pipeline/correction/correction_run.h"

namespace understory {

// What a run by stems tells of its path and how it was found: odometry.tum, trajectory.tum,
// steps.csv, loops.csv, corrections.csv in `folder`. Returns the corrected path as a reader of
// trajectory.tum gets it. Throws OutputError.
[[nodiscard]] Trajectory write_correction_tables(const std::filesystem::path& folder,
                                                 const CorrectionRun& run);

}  // namespace understory
