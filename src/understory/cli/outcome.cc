#include "understory/cli/outcome.h"

#include <cstdio>

namespace understory {

int report_outcome(const MappingOutcome& outcome) {
  std::printf("%s\n", outcome.summary.c_str());
  for (const std::string& reason : outcome.reasons)
    std::fprintf(stderr, "warning: result %s: %s\n", to_string(outcome.status).c_str(),
                 reason.c_str());
  return outcome.status == RunStatus::kComplete ? kExitDone : kExitUntrusted;
}

}  // namespace understory
