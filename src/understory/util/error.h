#pragma once

#include <stdexcept>
#include <string>
#include <vector>

namespace understory {

// The one exception family. Caught only in cli/ and in bindings; each kind has its exit code.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Input that cannot be used: says which file, where in it, and what was expected (exit code 3).
class InputError : public Error {
 public:
  InputError(const std::string& file, const std::string& position, const std::string& expected)
      : Error(file + (position.empty() ? "" : ": " + position) + ": " + expected), file_(file) {}
  [[nodiscard]] const std::string& file() const { return file_; }

 private:
  std::string file_;
};

// The place for the output is missing, full or not writable (exit code 3).
class OutputError : public Error {
 public:
  OutputError(const std::string& file, const std::string& reason)
      : Error(file + ": " + reason), file_(file) {}
  [[nodiscard]] const std::string& file() const { return file_; }

 private:
  std::string file_;
};

// Wrong configuration or usage; holds all problems found, not only the first (exit code 2).
class ConfigError : public Error {
 public:
  explicit ConfigError(std::vector<std::string> problems);
  [[nodiscard]] const std::vector<std::string>& problems() const { return problems_; }

 private:
  std::vector<std::string> problems_;
};

// A broken invariant: a defect of the program, not of its input (exit code 1).
class InternalError : public Error {
 public:
  using Error::Error;
};

namespace internal {
// Throws the error of a broken invariant, for UNDERSTORY_CHECK.
[[noreturn]] void check_failed(const char* condition, const char* file, int line);
}  // namespace internal

// Throws InternalError if the condition does not hold. Stays on in release builds.
#define UNDERSTORY_CHECK(condition)                                         \
  do {                                                                      \
    if (!(condition)) {                                                     \
      ::understory::internal::check_failed(#condition, __FILE__, __LINE__); \
    }                                                                       \
  } while (false)

}  // namespace understory
