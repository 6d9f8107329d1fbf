#include "understory/recording/captures/sensor_clock.h"

#include <cstdlib>

#include "understory/recording/messages/event_bytes.h"

namespace understory {
namespace {

constexpr TimeNs kSensorJump = kNsPerSecond / 2;
constexpr TimeNs kLatestSensorTime = std::int64_t{1} << 61;
constexpr TimeNs kSmoothedPackets = 8192;  // about ten seconds

}  // namespace

bool SensorClock::follows(const Reading& now, const Reading& before) {
  return std::llabs((now.sensor - before.sensor) - (now.stamp - before.stamp)) <= kSensorJump;
}

std::optional<TimeNs> SensorClock::time(TimeNs sensor, TimeNs stamp) {
  const auto impossible = [](TimeNs time) { return time < 0 || time > kLatestSensorTime; };
  if (impossible(sensor) || impossible(stamp)) return std::nullopt;
  const Reading reading{sensor, stamp};
  if (last_ && !follows(reading, *last_)) {
    const bool confirmed = jumped_ && follows(reading, *jumped_);
    jumped_ = reading;
    if (!confirmed) return std::nullopt;
    last_.reset();  // a real jump, of the sensor's clock or of the receiver's
  }
  jumped_.reset();
  if (!last_) {
    free_ = std::llabs(sensor - stamp) > kNsPerSecond;
    offset_ = free_ ? stamp - sensor : 0;
  }
  last_ = reading;
  if (free_) offset_ += (stamp - (sensor + offset_)) / kSmoothedPackets;
  return sensor + offset_;
}

void SensorClock::save(BinaryWriter& writer) const {
  put_optional(writer, last_);
  put_optional(writer, jumped_);
  writer.put(free_);
  writer.put(offset_);
}

void SensorClock::load(BinaryReader& reader) {
  last_ = get_optional<Reading>(reader);
  jumped_ = get_optional<Reading>(reader);
  free_ = reader.get<bool>();
  offset_ = reader.get<TimeNs>();
}

}  // namespace understory
