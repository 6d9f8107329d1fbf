#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "understory/util/files/file_lock.h"
#include "understory/util/files/output_guard.h"

namespace understory {

// A file that another part of the program writes from front to back under a name of its own. It
// appears whole or not at all. It is written to `part`. `commit` syncs it to the disk and renames
// it. The destructor drops it otherwise. One process at a time writes it. Not thread-safe.
class StagedFile {
 public:
  // Refuses as `place_of_file` does. Throws OutputError.
  StagedFile(const std::filesystem::path& path, bool overwrite);
  ~StagedFile();
  StagedFile(const StagedFile&) = delete;
  StagedFile& operator=(const StagedFile&) = delete;

  [[nodiscard]] const std::filesystem::path& part() const { return part_; }
  // Whether `commit` replaces a file.
  [[nodiscard]] bool replaces() const { return replaces_; }
  void commit();

 private:
  std::filesystem::path path_;
  std::filesystem::path part_;
  bool replaces_ = false;
  std::optional<FileLock> lock_;
};

// The same for a folder of files.
class StagedFolder {
 public:
  // A folder that is there already is refused unless it is empty, or `may_replace` holds for the
  // names of all files in it. Those go with `commit`. Throws OutputError.
  using NameTest = std::function<bool(const std::string& name)>;
  explicit StagedFolder(const std::filesystem::path& path, const NameTest& may_replace = {});
  ~StagedFolder();
  StagedFolder(const StagedFolder&) = delete;
  StagedFolder& operator=(const StagedFolder&) = delete;

  [[nodiscard]] const std::filesystem::path& part() const { return part_; }
  [[nodiscard]] bool replaces() const { return replaces_; }
  void commit();

 private:
  void check(const NameTest& may_replace);

  std::filesystem::path path_;
  std::filesystem::path part_;
  bool replaces_ = false;
  std::optional<MadeFolders> made_;
  std::optional<FileLock> lock_;
};

// A message with the names of files that the user asked for in place of those that they are
// written under.
[[nodiscard]] std::string with_final_names(std::string message);

}  // namespace understory
