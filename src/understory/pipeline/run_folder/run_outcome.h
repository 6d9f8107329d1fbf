#pragma once

#include <string>
#include <vector>

#include "understory/output/run_summary.h"

namespace understory {

// What a run of `map` or `correct` came to.
struct RunOutcome {
  RunStatus status = RunStatus::kComplete;
  std::vector<std::string> reasons;  // why partial or untrusted
  std::string summary;               // a few lines for the terminal
};

}  // namespace understory
