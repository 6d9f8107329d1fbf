#pragma once

#include <optional>
#include <string>
#include <vector>

#include "understory/util/log.h"
#include "understory/util/time.h"

namespace understory {

// When the clouds of a folder begin, one time for each, and where that comes from.
struct CloudFileTimes {
  std::vector<TimeNs> stamps;
  std::string
      source;         // "--rate-hz", "times.txt (seconds)", "file names (seconds.nanoseconds)", ...
  bool known = true;  // false: 10 Hz was assumed
};

// By design.md's order: `rate_hz` if it is positive, else times.txt in `folder`, else the names,
// else 10 Hz with a warning ("recording.assumed_rate"). `names` are file names in order. With fewer
// times than clouds the last clouds get none (`stamps` is shorter), with a warning. Throws
// InputError if times.txt holds anything but times.
[[nodiscard]] CloudFileTimes cloud_file_times(const std::string& folder,
                                              const std::vector<std::string>& names, double rate_hz,
                                              Log& log);

// The time in a file's name without its extension. It is seconds with a fraction
// ("1583840261.0399"), or seconds and nanoseconds ("cloud_1583840261_039995392"). It may also be
// one whole number of nano-, micro- or milliseconds or seconds since 1970. Nothing for a bare
// counter.
[[nodiscard]] std::optional<TimeNs> time_in_name(const std::string& stem);

// Orders names with their numbers by value: scan_2 before scan_10.
[[nodiscard]] bool natural_less(const std::string& a, const std::string& b);

// Times in text: all whole numbers with steps beyond 10 000 or beyond the epoch's seconds are
// nanoseconds, all others seconds. Nothing if one is no number.
[[nodiscard]] std::optional<std::vector<TimeNs>> parse_times(const std::vector<std::string>& texts,
                                                             bool& nanoseconds);

}  // namespace understory
