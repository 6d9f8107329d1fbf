#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "understory/recording/bags/byte_source.h"

namespace understory {

// Reads a file line by line from any position on; memory is bounded by the longest line (64 KiB,
// longer ones are cut). Line ends are \n or \r\n. Not thread-safe.
class TextLines {
 public:
  explicit TextLines(ByteSource& file, std::uint64_t position = 0)
      : file_(file), position_(position) {}

  // The next line, valid until the next call; false at the end.
  [[nodiscard]] bool next(std::string_view& line);
  // Where the line after the last one begins.
  [[nodiscard]] std::uint64_t position() const { return position_; }
  // Goes to the line that begins at a position, with so many lines before it.
  void go_to(std::uint64_t position, std::uint64_t lines_before) {
    position_ = position;
    number_ = lines_before;
  }
  // Number of lines returned so far.
  [[nodiscard]] std::uint64_t number() const { return number_; }

 private:
  ByteSource& file_;
  std::uint64_t position_;
  std::uint64_t number_ = 0;
  std::vector<std::uint8_t> window_;
  std::uint64_t window_begin_ = 0;
  std::string line_;
};

// The words between blanks, tabs (and nothing else).
[[nodiscard]] std::vector<std::string_view> split_words(std::string_view line);
void split_words(std::string_view line, std::vector<std::string_view>& words);
}  // namespace understory
