#include "understory/cli/outcome.h"

#include <cstdio>

namespace understory {

int report_outcome(const MappingOutcome& outcome) {
  std::printf("%s\n", outcome.summary.c_str());
  return outcome.status == RunStatus::kComplete ? kExitDone : kExitUntrusted;
}

}  // namespace understory
