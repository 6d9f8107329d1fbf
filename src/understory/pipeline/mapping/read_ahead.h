#pragma once

#include <deque>
#include <memory>
#include <utility>

#include "understory/recording/recording.h"

namespace understory {

// A recording whose first events have been read before; gives them first. `load` belongs to the
// recording itself.
class ReadAhead : public Recording {
 public:
  ReadAhead(std::unique_ptr<Recording> source, std::deque<Event> events)
      : source_(std::move(source)), events_(std::move(events)) {}

  [[nodiscard]] std::optional<Event> next() override {
    if (events_.empty()) return source_->next();
    Event event = std::move(events_.front());
    events_.pop_front();
    return event;
  }
  // The recording itself stands behind what is given, until that has caught up.
  [[nodiscard]] bool save(BinaryWriter& writer) const override {
    return events_.empty() && source_->save(writer);
  }
  [[nodiscard]] const Rig& rig() const override { return source_->rig(); }
  [[nodiscard]] std::vector<TopicReport> topics() const override { return source_->topics(); }
  [[nodiscard]] std::string format() const override { return source_->format(); }
  [[nodiscard]] double progress() const override { return source_->progress(); }

 private:
  std::unique_ptr<Recording> source_;
  std::deque<Event> events_;
};

}  // namespace understory
