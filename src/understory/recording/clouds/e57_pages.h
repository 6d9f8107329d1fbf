#pragma once

#include <cstdint>
#include <vector>

#include "understory/recording/bags/byte_source.h"

namespace understory {

// The bytes of an E57 file without the checksums: every 1,024 bytes hold 1,020 and their CRC-32C
// (ASTM E2807, section 9). "Physical" places count the checksums, "logical" ones do not. Not
// thread-safe.
class E57Pages {
 public:
  explicit E57Pages(ByteSource& file) : file_(file) {}

  // Reads up to `count` bytes from a physical place on; fewer only where the file ends or a
  // checksum is wrong. Returns the number read.
  [[nodiscard]] std::size_t read(std::uint64_t physical, std::uint8_t* into, std::size_t count);
  // The physical place `count` bytes behind another.
  [[nodiscard]] static std::uint64_t behind(std::uint64_t physical, std::uint64_t count);
  // Where a page was met whose checksum is wrong: its first byte; -1: nowhere.
  [[nodiscard]] std::int64_t damaged_at() const { return damaged_at_; }

 private:
  // Loads and checks the page. False where it is not there or its checksum is wrong.
  bool load(std::uint64_t page);

  ByteSource& file_;
  std::vector<std::uint8_t> page_;
  std::uint64_t loaded_ = ~std::uint64_t{0};
  std::int64_t damaged_at_ = -1;
};

// The same bytes in pages with their checksums; the last page is filled up with zeros.
[[nodiscard]] std::vector<std::uint8_t> e57_pages_of(ByteSpan logical);

}  // namespace understory
