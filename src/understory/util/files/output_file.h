#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace understory {

// A file that is written from front to back; every failure of the system is an OutputError that
// names the file and the reason. Keeps the CRC-32 of all bytes. Not thread-safe.
class OutputFile {
 public:
  explicit OutputFile(std::string path);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  void write(std::span<const std::uint8_t> bytes);
  // Syncs to the disk and closes.
  void close();
  // Closes without waiting for the disk: for files that are many and small.
  void close_unsynced();
  [[nodiscard]] std::uint64_t size() const { return size_; }
  [[nodiscard]] std::uint32_t crc() const { return crc_; }

 private:
  [[noreturn]] void fail();

  std::string path_;
  int descriptor_ = -1;
  std::uint64_t size_ = 0;
  std::uint32_t crc_ = 0;
  int error_ = 0;  // of the first failure; every later call fails with it
};

// CRC-32 as in zlib, also for more than 4 GB.
[[nodiscard]] std::uint32_t crc32_of(std::span<const std::uint8_t> bytes, std::uint32_t start = 0);

}  // namespace understory
