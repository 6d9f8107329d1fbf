#include "understory/cli/outcome.h"

#include <cstdio>

#include "understory/cli/command.h"

namespace understory {

int report_outcome(const std::string& summary, RunStatus status,
                   const std::vector<std::string>& reasons) {
  std::printf("%s\n", summary.c_str());
  for (const std::string& reason : reasons)
    std::fprintf(stderr, "warning: result %s: %s\n", to_string(status).c_str(), reason.c_str());
  return status == RunStatus::kComplete ? kExitDone : kExitUntrusted;
}

int report_stop(const std::string& what_is_left) {
  std::fprintf(stderr, "warning: stopped by the user: %s\n", what_is_left.c_str());
  return kExitUntrusted;
}

}  // namespace understory
