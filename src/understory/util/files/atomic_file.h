#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

namespace understory {

// A file that appears whole or not at all. It is written beside its place as `path.part`; `commit`
// syncs it to the disk, renames it, and syncs its folder. Without that the destructor drops it.
// Every failure is an OutputError with the file and the system's reason (disk full, not writable).
// Not thread-safe.
class AtomicFile {
 public:
  explicit AtomicFile(std::filesystem::path path);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  void write(std::string_view bytes);
  void commit();
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  struct Impl;
  std::filesystem::path path_;
  std::unique_ptr<Impl> impl_;
};

// Text gathered into large writes. Gzip-compressed where the path ends in .gz (with no time in its
// header, so that the same rows give the same bytes).
class AtomicTextFile {
 public:
  explicit AtomicTextFile(std::filesystem::path path);
  ~AtomicTextFile();
  AtomicTextFile(const AtomicTextFile&) = delete;
  AtomicTextFile& operator=(const AtomicTextFile&) = delete;

  void write(std::string_view text);
  void commit();

 private:
  struct Gzip;
  void drain(bool finish);

  AtomicFile file_;
  std::string buffer_;
  std::unique_ptr<Gzip> gzip_;
};

// For files that other programs write by themselves (GDAL). part_path gives a temporary path beside
// `path`. sync_and_rename syncs the file, renames it, and syncs its folder. Throws OutputError.
[[nodiscard]] std::filesystem::path part_path(const std::filesystem::path& path);
void sync_and_rename(const std::filesystem::path& from, const std::filesystem::path& to);

}  // namespace understory
