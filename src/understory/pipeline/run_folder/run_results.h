#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <vector>

namespace understory {

// Names of the files that a command may leave in a folder of results (docs/reference/outputs.md).
[[nodiscard]] const std::vector<std::string>& result_names();
[[nodiscard]] bool is_result_name(const std::string& name);

// The results that a command of this program has left in a folder, by its run.json there.
struct FormerResults {
  bool present = false;         // the folder holds a run.json of this program
  std::set<std::string> names;  // of its files, run.json included; some may be gone by now
};
[[nodiscard]] FormerResults former_results(const std::filesystem::path& folder);

// The first name of a result in the folder that is not one of `own`, or leads to anything but a
// regular file. Empty if there is none.
[[nodiscard]] std::string foreign_result(const std::filesystem::path& folder,
                                         const std::set<std::string>& own);

}  // namespace understory
