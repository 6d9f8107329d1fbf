#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "understory/util/error.h"

namespace understory {

// A place for the output that is not written to: what lies there would be lost, or another process
// is at work in it. Nothing was changed.
class RefusedOutput : public OutputError {
 public:
  using OutputError::OutputError;
};

// Refuses an output that would touch what is read. It must not be an input, lie in an input that is
// a folder, or be a folder that holds an input. Places are compared as the system sees them: by
// canonical path and by device and inode. Symbolic and hard links, `..`, other spellings and mounts
// are thus seen through. A folder that is an input stands for all that lies in it, also by a link.
// Empty names and names of nothing are passed over: they cannot be read, which their reader says.
// Touches nothing. Throws RefusedOutput.
void refuse_input_as_output(const std::filesystem::path& output,
                            const std::vector<std::filesystem::path>& inputs);

// Refuses a folder of results that cannot be made, because a part of its path is a file. Touches
// nothing. Throws RefusedOutput.
void refuse_folder_in_file(const std::filesystem::path& folder);

// The place of a single file to be written. Its folder must be there. A file that is there already
// is replaced only if `overwrite` is set; anything but a regular file never is. Returns the path
// behind symbolic links, which is what has to be replaced. Touches nothing. Throws RefusedOutput,
// and ConfigError for an empty name.
[[nodiscard]] std::filesystem::path place_of_file(const std::filesystem::path& path,
                                                  bool overwrite);

// Makes a folder and those above it that are missing. The destructor removes those that were made,
// as far as they are empty, unless `keep` was called. Throws OutputError; what was made until then
// is removed.
class MadeFolders {
 public:
  explicit MadeFolders(const std::filesystem::path& folder);
  ~MadeFolders();
  MadeFolders(const MadeFolders&) = delete;
  MadeFolders& operator=(const MadeFolders&) = delete;
  void keep() { made_.clear(); }
  // Waits until they are on the disk. Throws OutputError.
  void sync() const;

 private:
  std::vector<std::filesystem::path> made_;  // from the outside in
};

}  // namespace understory
