#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "understory/output/run_summary.h"

namespace understory {

// What a run said of its own result. Whatever is made of that result is no better.
struct InheritedTrust {
  RunStatus status = RunStatus::kComplete;
  std::vector<std::string> reasons;  // each begins with the name of the run: "run forest: ..."
};

// Reads `status` and `reasons` of RUN/run.json, where `run` is a run folder or a file in one. A
// run.json that cannot be read makes the result untrusted. A missing one does so, too, if `run` is
// a folder and one is `expected` there, or if its trajectory is no simulator's truth.
[[nodiscard]] InheritedTrust trust_of_run(const std::filesystem::path& run, bool expected = false);

// Lowers `status` to that of the run and adds its reasons in front of the others, each once.
void inherit(const InheritedTrust& trust, RunStatus& status, std::vector<std::string>& reasons);

}  // namespace understory
