#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <span>
#include <string>
#include <vector>

namespace understory {

// How far a RecordFile has come. What a checkpoint keeps of the file, to find exactly these bytes
// again: `digest` is a checksum of the checksums of all records.
struct RecordCount {
  std::uint64_t records = 0;
  std::uint64_t bytes = 0;
  std::uint64_t digest = 0;
  friend bool operator==(const RecordCount&, const RecordCount&) = default;
};

// A file of that name in a work folder, and how far of it a checkpoint counts on.
struct CountedFile {
  std::string name;
  RecordCount count;
};

// An append-only file of records, each with its length and a checksum that also tells its place.
// Appended records are in the system's hands at once, and on the disk after `sync`. Not
// thread-safe. Every failure to write is an OutputError.
class RecordFile {
 public:
  using Bytes = std::span<const std::uint8_t>;
  using Visit = std::function<void(std::uint64_t offset, Bytes record)>;

  // Begins anew.
  explicit RecordFile(std::filesystem::path path);
  // Goes on behind what is `known`; the rest is cut off. The places of the records are appended to
  // `offsets`. Only the records' heads are read. Throws InputError, with the file as it was, where
  // it is shorter or not the same.
  RecordFile(std::filesystem::path path, const RecordCount& known,
             std::vector<std::uint64_t>* offsets = nullptr);
  RecordFile(RecordFile&& other) noexcept;
  RecordFile& operator=(RecordFile&&) = delete;
  ~RecordFile();

  // Appends one record that consists of these parts (below 4 GiB); returns its place.
  std::uint64_t append(std::initializer_list<Bytes> parts);
  // Waits until all records are on the disk.
  void sync();
  [[nodiscard]] const RecordCount& count() const { return count_; }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  // The `record`th record, which begins at `offset`. Throws InputError where it is damaged.
  [[nodiscard]] std::vector<std::uint8_t> read(std::uint64_t record, std::uint64_t offset) const;
  // Hands over all records, checked. Throws InputError at the first that is damaged.
  void for_each(const Visit& visit) const;

 private:
  std::filesystem::path path_;
  int descriptor_ = -1;
  RecordCount count_;
  bool synced_ = true;
  bool failed_ = false;  // the end of the file is not known any more
};

// Reads a file from its beginning and hands over the records that are `known`, checked. Memory is
// that of the largest record in the file. Throws InputError at the first that is missing or
// damaged, and where they are not the same as those that were counted.
void for_each_record(const std::filesystem::path& path, const RecordCount& known,
                     const RecordFile::Visit& visit);

// The bytes of a value that can be copied byte by byte.
template <typename T>
[[nodiscard]] RecordFile::Bytes bytes_of(const T& value) {
  return {reinterpret_cast<const std::uint8_t*>(&value), sizeof(T)};
}
// The bytes of a text, without its length.
[[nodiscard]] inline RecordFile::Bytes bytes_of(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

}  // namespace understory
