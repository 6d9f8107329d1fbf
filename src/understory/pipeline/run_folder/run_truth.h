#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "understory/output/report.h"
#include "understory/recording/recording.h"

namespace understory {

// The simulator knows where it was: its truth is written to RUN.truth beside the run folder, and
// the finished trajectory, in `results`, is held against it, for the report alone. Nothing for
// other recordings.
[[nodiscard]] std::optional<ReportTruth> compare_with_truth(const std::filesystem::path& run_folder,
                                                            const std::filesystem::path& results,
                                                            const Recording& source);

}  // namespace understory
