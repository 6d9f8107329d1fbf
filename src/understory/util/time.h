#pragma once

#include <cstdint>
#include <string>

namespace understory {

// A point in time or a duration in nanoseconds. Sensor stamps are nanoseconds since the Unix epoch
// (or since power-on for recordings without a clock). Subtract before converting to double: the
// epoch does not fit a double to better than 100 ns.
using TimeNs = std::int64_t;

inline constexpr TimeNs kNsPerSecond = 1'000'000'000;
inline constexpr TimeNs kNsPerDay = 86'400 * kNsPerSecond;

// Duration in seconds; exact to 1 ns for durations up to about 100 days.
[[nodiscard]] inline double to_seconds(TimeNs duration) {
  return static_cast<double>(duration / kNsPerSecond) +
         static_cast<double>(duration % kNsPerSecond) * 1e-9;
}

// Nearest nanosecond to a duration in seconds. Not for absolute epoch times held in a double.
[[nodiscard]] TimeNs from_seconds(double seconds);

// "1700000000.123456789": seconds with nine decimals, exact (the stamp format of TUM files).
[[nodiscard]] std::string format_seconds(TimeNs time);

// Parses "1700000000.123456789" exactly, without passing through a double. Accepts a sign and any
// number of decimals (further ones than nine are dropped). Returns false on anything else.
[[nodiscard]] bool parse_seconds(const std::string& text, TimeNs& time);

}  // namespace understory
