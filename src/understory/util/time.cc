#include "understory/util/time.h"

#include <cctype>
#include <cmath>
#include <cstdlib>
#include <limits>

namespace understory {

TimeNs from_seconds(double seconds) {
  const double whole = std::floor(seconds);
  return static_cast<TimeNs>(whole) * kNsPerSecond +
         static_cast<TimeNs>(std::llround((seconds - whole) * 1e9));
}

std::string format_seconds(TimeNs time) {
  const bool negative = time < 0;
  const auto magnitude = static_cast<std::uint64_t>(negative ? -(time + 1) : time) +
                         static_cast<std::uint64_t>(negative ? 1 : 0);
  std::string fraction = std::to_string(magnitude % kNsPerSecond);
  fraction.insert(0, 9 - fraction.size(), '0');
  return (negative ? "-" : "") + std::to_string(magnitude / kNsPerSecond) + "." + fraction;
}

bool parse_seconds(const std::string& text, TimeNs& time) {
  std::size_t i = 0;
  const bool negative = i < text.size() && text[i] == '-';
  if (i < text.size() && (text[i] == '-' || text[i] == '+')) ++i;
  constexpr TimeNs kMaxSeconds = std::numeric_limits<TimeNs>::max() / kNsPerSecond - 1;
  TimeNs seconds = 0;
  TimeNs nanoseconds = 0;
  int digits = 0;
  for (; i < text.size() && std::isdigit(static_cast<unsigned char>(text[i])); ++i, ++digits) {
    seconds = seconds * 10 + (text[i] - '0');
    if (seconds > kMaxSeconds) return false;
  }
  if (i < text.size() && text[i] == '.') {
    ++i;
    TimeNs place = kNsPerSecond / 10;
    for (; i < text.size() && std::isdigit(static_cast<unsigned char>(text[i])); ++i, ++digits) {
      nanoseconds += (text[i] - '0') * place;
      place /= 10;
    }
  }
  if (digits == 0 || i != text.size()) return false;
  time = seconds * kNsPerSecond + nanoseconds;
  if (negative) time = -time;
  return true;
}

}  // namespace understory
