#include "understory/pipeline/judgement/imu_usage.h"

#include <algorithm>

#include "understory/odometry/imu/imu_buffer.h"

namespace understory {

void ImuUsage::add(const ImuSample& sample, bool has_place, const ImuNoiseConfig& config) {
  const TimeNs since = last_ ? sample.stamp - *last_ : 0;
  const TimeNs step = std::clamp<TimeNs>(since, 0, kNsPerSecond / 10);
  last_ = sample.stamp;
  if (!has_place) {
    without_place_ += step;
  } else if (defect_of(sample, config) != SampleDefect::kNone) {
    unusable_ += step;
  }
}

void ImuUsage::save(BinaryWriter& writer) const {
  writer.put(last_.has_value());
  writer.put(last_.value_or(0));
  writer.put(without_place_);
  writer.put(unusable_);
}

void ImuUsage::load(BinaryReader& reader) {
  const bool any = reader.get<bool>();
  const auto last = reader.get<TimeNs>();
  last_ = any ? std::optional<TimeNs>(last) : std::nullopt;
  without_place_ = reader.get<TimeNs>();
  unusable_ = reader.get<TimeNs>();
}

}  // namespace understory
