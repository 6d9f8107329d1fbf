#include "understory/util/log.h"

namespace understory {

void Log::warn(const std::string& key, const std::string& message) {
  constexpr std::size_t kPassedOn = 3;
  std::size_t count = 0;
  {
    const std::lock_guard lock(mutex_);
    Warning& warning = warnings_[key];
    if (warning.count == 0) {
      warning.key = key;
      warning.first_message = message;
    }
    count = ++warning.count;
  }
  // The pages of the program explain warnings by their keys.
  if (count <= kPassedOn) pass(LogLevel::kWarning, message + " [" + key + "]");
  if (count == kPassedOn) pass(LogLevel::kWarning, "(further warnings of this kind are counted)");
}

std::vector<Log::Warning> Log::warnings() const {
  const std::lock_guard lock(mutex_);
  std::vector<Warning> result;
  for (const auto& [key, warning] : warnings_)
    result.push_back(warning);
  return result;
}

void Log::restore(const std::vector<Warning>& warnings) {
  const std::lock_guard lock(mutex_);
  for (const Warning& warning : warnings)
    warnings_[warning.key] = warning;
}

void Log::forget_all_but(const std::string& key) {
  const std::lock_guard lock(mutex_);
  for (auto it = warnings_.begin(); it != warnings_.end();)
    it = it->first == key ? std::next(it) : warnings_.erase(it);
}

void Log::pass(LogLevel level, const std::string& message) {
  if (!sink_) return;
  const std::lock_guard lock(mutex_);
  sink_(level, message);
}

}  // namespace understory
