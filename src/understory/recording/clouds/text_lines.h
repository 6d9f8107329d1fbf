#pragma once

#include <charconv>
#include <cstdint>
#include <optional>
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
// The cells between separators, without the blanks around them.
[[nodiscard]] std::vector<std::string_view> split_cells(std::string_view line, char separator);

// A whole text as a number ("nan" and "inf" included); nothing if it is none.
[[nodiscard]] inline std::optional<double> to_number(std::string_view text) {
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (end != text.data() + text.size() || text.empty()) return std::nullopt;
  if (error == std::errc::result_out_of_range) return value;
  if (error != std::errc()) return std::nullopt;
  return value;
}

[[nodiscard]] inline std::optional<std::uint64_t> to_count(std::string_view text) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

}  // namespace understory
