#include "understory/recording/clouds/text_lines.h"

#include <algorithm>

namespace understory {
namespace {

constexpr std::size_t kWindow = 1U << 16;
constexpr std::size_t kLongestLine = 1U << 16;

}  // namespace

bool TextLines::next(std::string_view& line) {
  line_.clear();
  bool any = false;
  while (true) {
    if (position_ < window_begin_ || position_ >= window_begin_ + window_.size()) {
      file_.read(position_, kWindow, window_);
      window_begin_ = position_;
      if (window_.empty()) break;
    }
    any = true;
    const auto begin = window_.begin() + static_cast<std::ptrdiff_t>(position_ - window_begin_);
    const auto end = std::find(begin, window_.end(), std::uint8_t{'\n'});
    if (line_.size() < kLongestLine) line_.append(begin, end);
    position_ += static_cast<std::uint64_t>(end - begin);
    if (end == window_.end()) continue;
    ++position_;
    break;
  }
  if (!any) return false;
  ++number_;
  if (!line_.empty() && line_.back() == '\r') line_.pop_back();
  line = line_;
  return true;
}

void split_words(std::string_view line, std::vector<std::string_view>& words) {
  words.clear();
  std::size_t at = 0;
  while (true) {
    while (at < line.size() && (line[at] == ' ' || line[at] == '\t' || line[at] == '\r'))
      ++at;
    if (at >= line.size()) return;
    const std::size_t end = std::min(line.find_first_of(" \t\r", at), line.size());
    words.push_back(line.substr(at, end - at));
    at = end;
  }
}

std::vector<std::string_view> split_words(std::string_view line) {
  std::vector<std::string_view> words;
  split_words(line, words);
  return words;
}

}  // namespace understory
