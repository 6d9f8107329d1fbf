#pragma once

#include <unistd.h>

#include <filesystem>
#include <string>

#include "understory/util/error.h"

namespace understory {

// A folder for the files of one fuzzing process, made at the first call.
inline const std::filesystem::path& fuzz_folder() {
  static const std::filesystem::path path = [] {
    const auto made =
        std::filesystem::temp_directory_path() / ("understory_fuzz_" + std::to_string(::getpid()));
    std::filesystem::create_directories(made);
    return made;
  }();
  return path;
}

// Damaged state of a run has to end in an InputError.
template <typename Work>
void expect_input_error_at_most(const Work& work) {
  try {
    work();
  } catch (const InputError&) {
  }
}

}  // namespace understory
