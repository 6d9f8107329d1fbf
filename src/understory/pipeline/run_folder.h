#pragma once

#include <filesystem>

namespace understory {

// The part of a run folder that an unfinished mapping run goes on from.
[[nodiscard]] std::filesystem::path checkpoint_of(const std::filesystem::path& run_folder);

// OutputError if the folder holds a mapping run that is not finished.
void refuse_unfinished_run(const std::filesystem::path& run_folder);

// Removes the results that an earlier run left, so that none stands beside those of another.
void remove_old_results(const std::filesystem::path& run_folder);

}  // namespace understory
