#include "understory/util/error.h"

#include <cstring>

namespace understory {
namespace {

std::string join(const std::vector<std::string>& problems) {
  std::string text;
  for (const std::string& problem : problems) {
    if (!text.empty()) text += "\n";
    text += problem;
  }
  return text;
}

}  // namespace

ConfigError::ConfigError(std::vector<std::string> problems)
    : Error(join(problems)), problems_(std::move(problems)) {}

namespace internal {

void check_failed(const char* condition, const char* file, int line) {
  const char* name = std::strstr(file, "understory/");
  throw InternalError(std::string("broken invariant: ") + condition + " (" +
                      (name != nullptr ? name : file) + ":" + std::to_string(line) + ")");
}

}  // namespace internal
}  // namespace understory
