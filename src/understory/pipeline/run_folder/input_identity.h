#pragma once

#include <string>
#include <vector>

namespace understory {

// By what an input is known again without reading all of it.
struct InputIdentity {
  std::string what;  // "the recording", "the extrinsics"
  std::string path;  // as given
  std::string mark;  // of a file its size and checksums of its first and last MiB; of a simulation
                     // those of its files. Of a folder those of the names and sizes of all its
                     // files, and of a bag's parts elsewhere
};

// Throws InputError where it cannot be read.
[[nodiscard]] InputIdentity identify(const std::string& what, const std::string& path);

// Throws InputError, naming both places, if `now` is not what the run was begun with.
void expect_same(const std::vector<InputIdentity>& begun_with,
                 const std::vector<InputIdentity>& now);

}  // namespace understory
