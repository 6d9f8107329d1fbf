#pragma once

#include <string>
#include <vector>

#include "understory/output/run_summary.h"

namespace understory {

// Prints what a run came to on stdout, and what to distrust of it on stderr; returns its exit code.
[[nodiscard]] int report_outcome(const std::string& summary, RunStatus status,
                                 const std::vector<std::string>& reasons);
template <typename Outcome>
[[nodiscard]] int report_outcome(const Outcome& outcome) {
  return report_outcome(outcome.summary, outcome.status, outcome.reasons);
}

// Says that the user stopped the command, and what is left of its work; returns the exit code.
[[nodiscard]] int report_stop(const std::string& what_is_left);

}  // namespace understory
