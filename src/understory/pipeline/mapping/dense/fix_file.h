#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "understory/sensor/gnss_fix.h"
#include "understory/util/files/record_file.h"

namespace understory {

// Append-only file of the fixes of a run, so that memory does not grow with its length. There is no
// file until the first fix comes. Not thread-safe. Throws OutputError where the disk is full.
class FixFile {
 public:
  explicit FixFile(std::filesystem::path path) : path_(std::move(path)) {}
  // Goes on behind the fixes that are `known`. Throws InputError where they are not there.
  void go_on(const RecordCount& known);

  void append(const std::vector<GnssFix>& fixes);
  // Waits until all fixes are on the disk.
  void sync();
  // Of what was appended.
  [[nodiscard]] std::size_t size() const { return static_cast<std::size_t>(count().records); }
  [[nodiscard]] RecordCount count() const { return file_ ? file_->count() : RecordCount(); }
  [[nodiscard]] std::string name() const { return path_.filename().string(); }
  [[nodiscard]] bool exists() const { return file_ != nullptr; }
  // All fixes in their order, read anew. Throws InputError at the first record that is damaged.
  [[nodiscard]] std::vector<GnssFix> read() const;

 private:
  std::filesystem::path path_;
  std::unique_ptr<RecordFile> file_;
};

}  // namespace understory
