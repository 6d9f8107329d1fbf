#include "understory/recording/lidars/steady_scans.h"

#include <cstdlib>
#include <utility>

#include "understory/recording/messages/event_bytes.h"
#include "understory/recording/recording_constants.h"

namespace understory {

std::vector<ScanPtr> SteadyScans::add(ScanPtr scan) {
  const auto far = [](TimeNs a, TimeNs b) {
    return std::llabs(a - b) > recording_constants::merged_lidars::kJump;
  };
  const TimeNs stamp = scan->stamp;
  std::vector<ScanPtr> certain;
  if (any_ && far(stamp, last_)) {
    if (doubtful_ == nullptr || far(stamp, doubtful_->stamp)) {
      left_out_ += doubtful_ == nullptr ? 0 : 1;
      doubtful_ = std::move(scan);
      return certain;
    }
    certain.push_back(std::move(doubtful_));
  } else if (doubtful_ != nullptr) {
    ++left_out_;
  }
  doubtful_ = nullptr;
  any_ = true;
  last_ = stamp;
  certain.push_back(std::move(scan));
  return certain;
}

void SteadyScans::save(BinaryWriter& writer) const {
  writer.put(any_);
  writer.put(last_);
  put_scan(writer, doubtful_);
  writer.put(left_out_);
}

void SteadyScans::load(BinaryReader& reader) {
  any_ = reader.get<bool>();
  last_ = reader.get<TimeNs>();
  doubtful_ = get_scan(reader);
  left_out_ = reader.get<std::uint64_t>();
}

}  // namespace understory
