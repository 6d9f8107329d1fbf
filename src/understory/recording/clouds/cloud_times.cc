#include "understory/recording/clouds/cloud_times.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>

#include "understory/recording/bags/byte_source.h"
#include "understory/recording/clouds/text_lines.h"
#include "understory/recording/finding.h"
#include "understory/util/error.h"
#include "understory/util/files/csv.h"

namespace understory {
namespace {

constexpr double kAssumedRate = 10.0;
constexpr std::int64_t kFirstEpochSecond = 900'000'000;   // 1998
constexpr std::int64_t kLastEpochSecond = 4'000'000'000;  // 2096

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

// A run of digits.
struct NumberInName {
  std::string digits;
  std::size_t position = 0;
};

std::vector<NumberInName> numbers_in(const std::string& name) {
  std::vector<NumberInName> numbers;
  for (std::size_t i = 0; i < name.size();) {
    if (!is_digit(name[i])) {
      ++i;
      continue;
    }
    std::size_t end = i;
    while (end < name.size() && is_digit(name[end]))
      ++end;
    numbers.push_back({name.substr(i, end - i), i});
    i = end;
  }
  return numbers;
}

bool is_epoch_second(const std::string& digits) {
  const auto value = digits.size() <= 10 ? to_count(digits) : std::nullopt;
  return value && static_cast<std::int64_t>(*value) >= kFirstEpochSecond &&
         static_cast<std::int64_t>(*value) <= kLastEpochSecond;
}

// Whole numbers since 1970 by their number of digits.
std::optional<TimeNs> epoch_number(const std::string& digits) {
  const auto value = to_count(digits);
  if (!value) return std::nullopt;
  const auto number = static_cast<std::int64_t>(*value);
  switch (digits.size()) {
    case 18:
    case 19:
      return number > 0 ? std::optional(number) : std::nullopt;
    case 16:
      return number * 1000;
    case 13:
      return number * 1'000'000;
    case 10:
      return is_epoch_second(digits) ? std::optional(number * kNsPerSecond) : std::nullopt;
    default:
      return std::nullopt;
  }
}

std::optional<TimeNs> parse_time_text(const std::string& text) {
  TimeNs time = 0;
  if (parse_seconds(text, time)) return time;
  const auto value = to_number(text);  // 1.037e-01, as KITTI writes
  if (!value || !(std::abs(*value) < 9e9)) return std::nullopt;
  return from_seconds(*value);
}

std::vector<std::string> words_of_times_file(const std::string& path) {
  const auto file = open_file(path);
  TextLines lines(*file);
  std::string_view line;
  std::vector<std::string> texts;
  std::vector<std::string_view> words;
  while (lines.next(line)) {
    split_words(line, words);
    if (words.empty() || words[0].front() == '#') continue;
    if (words.size() > 1) {
      throw InputError(path, "line " + std::to_string(lines.number()),
                       "expected one time, in seconds or nanoseconds");
    }
    texts.emplace_back(words[0]);
  }
  return texts;
}

CloudFileTimes times_of_file(const std::string& path, std::size_t clouds, Log& log) {
  const std::vector<std::string> texts = words_of_times_file(path);
  bool nanoseconds = false;
  auto stamps = parse_times(texts, nanoseconds);
  if (!stamps) throw InputError(path, "", "expected one time a line, in seconds or nanoseconds");
  if (stamps->size() != clouds) {
    log.warn("recording.times",
             path + ": " + std::to_string(stamps->size()) + " times for " + std::to_string(clouds) +
                 " clouds" + (stamps->size() < clouds ? "; the last clouds are left out" : ""));
    stamps->resize(std::min(stamps->size(), clouds));
  }
  return {*stamps, nanoseconds ? "times.txt (nanoseconds)" : "times.txt (seconds)", true};
}

std::vector<TimeNs> regular_times(std::size_t count, double rate_hz) {
  std::vector<TimeNs> stamps;
  for (std::size_t i = 0; i < count; ++i)
    stamps.push_back(from_seconds(static_cast<double>(i) / rate_hz));
  return stamps;
}

}  // namespace

std::optional<TimeNs> time_in_name(const std::string& stem) {
  const std::vector<NumberInName> numbers = numbers_in(stem);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const std::string& digits = numbers[i].digits;
    const std::size_t end = numbers[i].position + digits.size();
    const bool adjacent = i + 1 < numbers.size() && numbers[i + 1].position == end + 1;
    const char link = adjacent ? stem[end] : '\0';
    const std::string next = adjacent ? numbers[i + 1].digits : "";
    TimeNs time = 0;
    if (link == '.' && digits.size() <= 10 && parse_seconds(digits + "." + next, time)) return time;
    if (is_epoch_second(digits) && (link == '_' || link == '-') && next.size() <= 9) {
      return static_cast<TimeNs>(*to_count(digits)) * kNsPerSecond +
             static_cast<TimeNs>(*to_count(next));
    }
    if (const auto epoch = epoch_number(digits)) return epoch;
  }
  return std::nullopt;
}

bool natural_less(const std::string& a, const std::string& b) {
  std::size_t i = 0;
  std::size_t j = 0;
  while (i < a.size() && j < b.size()) {
    if (is_digit(a[i]) && is_digit(b[j])) {
      std::size_t end_a = i;
      std::size_t end_b = j;
      while (end_a < a.size() && is_digit(a[end_a]))
        ++end_a;
      while (end_b < b.size() && is_digit(b[end_b]))
        ++end_b;
      while (i < end_a && a[i] == '0')
        ++i;
      while (j < end_b && b[j] == '0')
        ++j;
      if (end_a - i != end_b - j) return end_a - i < end_b - j;
      const int order = a.compare(i, end_a - i, b, j, end_b - j);
      if (order != 0) return order < 0;
      i = end_a;
      j = end_b;
      continue;
    }
    if (a[i] != b[j]) return a[i] < b[j];
    ++i;
    ++j;
  }
  if (a.size() - i != b.size() - j) return a.size() - i < b.size() - j;
  return a < b;
}

std::optional<std::vector<TimeNs>> parse_times(const std::vector<std::string>& texts,
                                               bool& nanoseconds) {
  constexpr std::uint64_t kLongestStep = 10'000;
  constexpr std::uint64_t kBeyondSeconds = 100'000'000'000;
  std::vector<std::uint64_t> whole;
  for (const std::string& text : texts) {
    if (const auto number = to_count(text)) whole.push_back(*number);
  }
  nanoseconds = whole.size() == texts.size() && !whole.empty();
  if (nanoseconds) {
    const auto [low, high] = std::minmax_element(whole.begin(), whole.end());
    const std::uint64_t steps = whole.size() - 1;
    nanoseconds = *high > kBeyondSeconds || (steps > 0 && (*high - *low) / steps > kLongestStep);
  }
  std::vector<TimeNs> times;
  for (std::size_t i = 0; i < texts.size(); ++i) {
    if (nanoseconds) {
      if (whole[i] > static_cast<std::uint64_t>(INT64_MAX)) return std::nullopt;
      times.push_back(static_cast<TimeNs>(whole[i]));
    } else {
      const auto time = parse_time_text(texts[i]);
      if (!time) return std::nullopt;
      times.push_back(*time);
    }
  }
  return times;
}

CloudFileTimes cloud_file_times(const std::string& folder, const std::vector<std::string>& names,
                                double rate_hz, Log& log) {
  namespace fs = std::filesystem;
  if (rate_hz > 0.0) return {regular_times(names.size(), rate_hz), "--rate-hz", true};
  const fs::path times_file = fs::path(folder) / "times.txt";
  std::error_code error;
  if (fs::is_regular_file(times_file, error))
    return times_of_file(times_file.string(), names.size(), log);
  std::vector<TimeNs> stamps;
  for (const std::string& name : names) {
    const auto time = time_in_name(fs::path(name).stem().string());
    if (!time) break;
    stamps.push_back(*time);
  }
  if (stamps.size() == names.size()) return {stamps, "file names", true};
  report_finding(log, Finding::kAssumedTimes,
                 folder +
                     ": neither --rate-hz nor times.txt nor times in the names: 10 clouds a second "
                     "are assumed");
  return {regular_times(names.size(), kAssumedRate), names.size() > 1 ? "assumed 10 Hz" : "none",
          false};
}

}  // namespace understory
