#pragma once

#include <filesystem>
#include <optional>

#include "understory/evaluation/trajectory.h"
#include "understory/output/report/report.h"
#include "understory/recording/recording.h"

namespace understory {

// The simulator knows where it was: its truth is written to RUN.truth beside the run folder, and
// its trajectory is given. Nothing for other recordings.
[[nodiscard]] std::optional<Trajectory> write_truth(const std::filesystem::path& run_folder,
                                                    const Recording& source);

// The finished trajectory held against the truth, for the report alone. Nothing where they have no
// time in common.
[[nodiscard]] std::optional<ReportTruth> compare_with_truth(const Trajectory& estimate,
                                                            const Trajectory& truth);

}  // namespace understory
