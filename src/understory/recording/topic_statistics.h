#pragma once

#include <algorithm>
#include <utility>

#include "understory/recording/recording.h"

namespace understory {

// Keeps a topic's report up to date with the stamps of its messages.
class TopicStatistics {
 public:
  TopicStatistics() = default;
  explicit TopicStatistics(TopicReport report) : report_(std::move(report)) {}

  void add_stamp(TimeNs stamp) {
    if (report_.messages++ == 0) {
      report_.first_stamp = report_.last_stamp = stamp;
    } else if (stamp < previous_) {
      ++report_.backward_steps;
    } else if (stamp == previous_) {
      ++report_.duplicates;
    } else {
      report_.longest_gap = std::max(report_.longest_gap, stamp - previous_);
    }
    previous_ = stamp;
    report_.first_stamp = std::min(report_.first_stamp, stamp);
    report_.last_stamp = std::max(report_.last_stamp, stamp);
  }
  [[nodiscard]] TopicReport& report() { return report_; }
  [[nodiscard]] const TopicReport& report() const { return report_; }

 private:
  TopicReport report_;
  TimeNs previous_ = 0;
};

}  // namespace understory
