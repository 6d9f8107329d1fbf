#pragma once

#include <filesystem>
#include <optional>

namespace understory {

// A lock on a file, held by one process at a time. The system lets it go when the process ends,
// however that comes about. Where the file system knows no locks it is held without effect.
class FileLock {
 public:
  // Makes the file if it is missing and writes the process's number into it; a folder is locked as
  // it is. None if another process holds it. Throws OutputError if the file cannot be opened.
  [[nodiscard]] static std::optional<FileLock> take(const std::filesystem::path& path);
  // The process that holds the lock on the file; none if nobody does. 0: its number is not known.
  [[nodiscard]] static std::optional<long> holder(const std::filesystem::path& path);

  ~FileLock();
  FileLock(FileLock&& other) noexcept;
  FileLock& operator=(FileLock&& other) noexcept;

 private:
  explicit FileLock(int descriptor) : descriptor_(descriptor) {}
  int descriptor_ = -1;
};

}  // namespace understory
