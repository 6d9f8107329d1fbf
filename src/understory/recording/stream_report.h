#pragma once

#include <algorithm>

#include "understory/recording/recording.h"

namespace understory {

// Counts one message of a stream into its report.
inline void count_message(TopicReport& report, TimeNs stamp, std::uint64_t points = 0) {
  if (report.messages == 0) {
    report.first_stamp = report.last_stamp = stamp;
  } else if (stamp < report.last_stamp) {
    ++report.backward_steps;
  } else {
    report.longest_gap = std::max(report.longest_gap, stamp - report.last_stamp);
    report.last_stamp = stamp;
  }
  ++report.messages;
  report.points += points;
}

}  // namespace understory
