#include "understory/recording/recording.h"

#include "understory/util/error.h"

namespace understory {
namespace {

struct TimeOf {
  TimeNs operator()(const ScanPtr& scan) const { return scan->end(); }
  TimeNs operator()(const ImuSample& sample) const { return sample.stamp; }
  TimeNs operator()(const GnssFix& fix) const { return fix.stamp; }
  TimeNs operator()(const MagSample& sample) const { return sample.stamp; }
};

}  // namespace

TimeNs event_time(const Event& event) {
  return std::visit(TimeOf{}, event);
}

std::uint64_t unusable_messages(const Recording& recording, const std::string& role) {
  std::uint64_t count = 0;
  for (const TopicReport& topic : recording.topics())
    count += topic.role == role ? topic.unreadable + topic.not_numbers : 0;
  return count;
}

void Recording::skip(std::uint64_t count) {
  for (std::uint64_t i = 0; i < count; ++i) {
    if (!next()) return;
  }
}

bool Recording::save(BinaryWriter& /*writer*/) const {
  return false;
}

void Recording::load(BinaryReader& /*reader*/) {
  UNDERSTORY_CHECK(false && "a recording that cannot tell its place cannot go to it");
}

}  // namespace understory
