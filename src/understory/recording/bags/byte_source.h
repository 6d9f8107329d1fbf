#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "understory/recording/bytes.h"

namespace understory {

// Bytes that can be read at any place: a file, or memory in tests. Not thread-safe.
class ByteSource {
 public:
  virtual ~ByteSource() = default;
  // Reads up to `count` bytes from `offset` on; fewer only at the end. Returns the number read.
  // Throws ReadError where the system cannot read the file.
  [[nodiscard]] virtual std::size_t read(std::uint64_t offset, std::uint8_t* into,
                                         std::size_t count) = 0;
  [[nodiscard]] virtual std::uint64_t size() const = 0;
  // For messages: the file's path.
  [[nodiscard]] virtual const std::string& name() const = 0;

  // The bytes of [offset, offset + count) that are there, in `into`.
  void read(std::uint64_t offset, std::uint64_t count, std::vector<std::uint8_t>& into);
};

// Throws InputError if the file is missing, is not a plain file or cannot be read.
[[nodiscard]] std::unique_ptr<ByteSource> open_file(const std::string& path);
// The same under another name for messages.
[[nodiscard]] std::unique_ptr<ByteSource> open_file(const std::string& path, std::string name);
[[nodiscard]] std::unique_ptr<ByteSource> bytes_in_memory(std::vector<std::uint8_t> bytes,
                                                          std::string name);

}  // namespace understory
