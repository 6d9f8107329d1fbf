#pragma once

#include <algorithm>
#include <utility>

#include "understory/recording/recording.h"
#include "understory/util/files/binary_io.h"

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
  void save(BinaryWriter& writer) const {
    for (const std::string& text :
         {report_.name, report_.type, report_.frame, report_.role, report_.conventions})
      writer.put(text);
    for (const std::uint64_t count :
         {report_.messages, report_.backward_steps, report_.duplicates, report_.unreadable,
          report_.not_numbers, report_.left_out, report_.points, report_.empty_points})
      writer.put(count);
    for (const TimeNs time :
         {report_.first_stamp, report_.last_stamp, report_.longest_gap, previous_})
      writer.put(time);
  }
  void load(BinaryReader& reader) {
    for (std::string* text :
         {&report_.name, &report_.type, &report_.frame, &report_.role, &report_.conventions})
      *text = reader.get_string();
    for (std::uint64_t* count :
         {&report_.messages, &report_.backward_steps, &report_.duplicates, &report_.unreadable,
          &report_.not_numbers, &report_.left_out, &report_.points, &report_.empty_points})
      *count = reader.get<std::uint64_t>();
    for (TimeNs* time :
         {&report_.first_stamp, &report_.last_stamp, &report_.longest_gap, &previous_})
      *time = reader.get<TimeNs>();
  }
  [[nodiscard]] TopicReport& report() { return report_; }
  [[nodiscard]] const TopicReport& report() const { return report_; }

 private:
  TopicReport report_;
  TimeNs previous_ = 0;
};

}  // namespace understory
