#pragma once

#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <vector>

namespace understory {

// How urgent a message is.
enum class LogLevel { kDebug, kInfo, kWarning, kError };

// Where the library's messages go. The library never prints; a Log is passed to whatever may have
// something to say. Thread-safe.
//
// Warnings are kept as well as passed on, because a run's warnings belong in its run.json. A
// warning has a `key` that names its kind ("imu.gap"). The first three of a kind are passed to the
// sink at once, and all are counted. So a defect that repeats a million times neither floods the
// terminal nor fills the memory.
class Log {
 public:
  using Sink = std::function<void(LogLevel, const std::string&)>;

  struct Warning {
    std::string key;
    std::string first_message;
    std::size_t count = 0;
  };

  Log() = default;  // keeps warnings, passes nothing on
  explicit Log(Sink sink) : sink_(std::move(sink)) {}

  void debug(const std::string& message) { pass(LogLevel::kDebug, message); }
  void info(const std::string& message) { pass(LogLevel::kInfo, message); }
  void error(const std::string& message) { pass(LogLevel::kError, message); }
  void warn(const std::string& key, const std::string& message);

  // The warnings so far, one per kind, sorted by key.
  [[nodiscard]] std::vector<Warning> warnings() const;
  // Puts back warnings of an earlier part of the run (a resumed run reports them all).
  void restore(const std::vector<Warning>& warnings);
  // Forgets all warnings but those of this kind (work is begun anew).
  void forget_all_but(const std::string& key);

 private:
  void pass(LogLevel level, const std::string& message);

  Sink sink_;
  mutable std::mutex mutex_;
  std::map<std::string, Warning> warnings_;
};

}  // namespace understory
