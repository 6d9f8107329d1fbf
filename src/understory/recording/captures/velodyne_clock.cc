#include "understory/recording/captures/velodyne_clock.h"

#include <cstdlib>

#include "understory/recording/messages/event_bytes.h"

namespace understory {
namespace {

constexpr std::int64_t kHourUs = 3'600'000'000;
constexpr TimeNs kHour = 3600 * kNsPerSecond;
constexpr std::int64_t kJumpUs = 500'000;
constexpr TimeNs kSynchronised = kNsPerSecond;
constexpr TimeNs kSentenceAge = 5 * kNsPerSecond / 2;  // a sentence tells of the second before it
constexpr TimeNs kSmoothing = 8192;                    // packets: about ten seconds

// The difference that lies within half an hour of `near_us`, the counter being modulo one hour.
std::int64_t unwrap(std::int64_t difference_us, std::int64_t near_us) {
  std::int64_t over = (difference_us - near_us) % kHourUs;
  if (over > kHourUs / 2) over -= kHourUs;
  if (over < -kHourUs / 2) over += kHourUs;
  return near_us + over;
}

TimeNs floor_hour(TimeNs time) {
  return time - ((time % kHour) + kHour) % kHour;
}

// The time with this counter that is nearest to `near`.
TimeNs nearest(std::uint32_t counter_us, TimeNs near) {
  TimeNs time = floor_hour(near) + static_cast<TimeNs>(counter_us) * 1000;
  if (time - near > kHour / 2) time -= kHour;
  if (near - time > kHour / 2) time += kHour;
  return time;
}

}  // namespace

bool VelodyneClock::follows(std::uint32_t counter_us, TimeNs stamp, std::uint32_t before_us,
                            TimeNs before_stamp) const {
  const std::int64_t expected = (stamp - before_stamp) / 1000;
  const std::int64_t difference =
      unwrap(static_cast<std::int64_t>(counter_us) - before_us, expected);
  return std::llabs(difference - expected) <= kJumpUs;
}

std::optional<TimeNs> VelodyneClock::time(std::uint32_t counter_us, TimeNs stamp) {
  if (counter_us >= kHourUs || std::llabs(stamp) > std::int64_t{1} << 62) return std::nullopt;
  const Reading reading{counter_us, stamp};
  if (last_ && !follows(counter_us, stamp, last_->counter_us, last_->stamp)) {
    const bool confirmed =
        jumped_ && follows(counter_us, stamp, jumped_->counter_us, jumped_->stamp);
    jumped_ = reading;
    if (!confirmed) return std::nullopt;
    last_.reset();  // a real jump, of the sensor's clock or of the receiver's
  }
  jumped_.reset();
  if (last_) {
    const std::int64_t difference = static_cast<std::int64_t>(counter_us) - last_->counter_us;
    elapsed_us_ += unwrap(difference, (stamp - last_->stamp) / 1000);
    last_ = reading;
  } else {
    last_ = reading;
    anchor(stamp);
  }
  if (source_ == Source::kFree) base_ += (stamp - (base_ + elapsed_us_ * 1000)) / kSmoothing;
  return base_ + elapsed_us_ * 1000;
}

void VelodyneClock::anchor(TimeNs stamp) {
  elapsed_us_ = 0;
  if (hour_) {
    const auto counter = static_cast<std::int64_t>(last_->counter_us);
    base_ = *hour_ + (hour_counter_us_ + unwrap(counter - hour_counter_us_, 0)) * 1000;
    source_ = Source::kPosition;
    return;
  }
  base_ = nearest(last_->counter_us, stamp);
  source_ = Source::kStamp;
  if (std::llabs(base_ - stamp) > kSynchronised) {
    base_ = stamp;
    source_ = Source::kFree;
  }
}

bool VelodyneClock::set_utc(std::uint32_t counter_us, TimeNs utc) {
  if (counter_us >= kHourUs) return false;
  const TimeNs time = nearest(counter_us, utc);
  if (time < utc - kNsPerSecond || time > utc + kSentenceAge) return false;
  hour_ = time - static_cast<TimeNs>(counter_us) * 1000;
  hour_counter_us_ = counter_us;
  if (last_) {
    const std::int64_t ahead = unwrap(static_cast<std::int64_t>(counter_us) - last_->counter_us, 0);
    base_ = time - (elapsed_us_ + ahead) * 1000;
    source_ = Source::kPosition;
  }
  return true;
}

void VelodyneClock::save(BinaryWriter& writer) const {
  writer.put(source_);
  put_optional(writer, last_);
  put_optional(writer, jumped_);
  writer.put(elapsed_us_);
  writer.put(base_);
  put_optional(writer, hour_);
  writer.put(hour_counter_us_);
}

void VelodyneClock::load(BinaryReader& reader) {
  source_ = reader.get_enum(Source::kFree);
  last_ = get_optional<Reading>(reader);
  jumped_ = get_optional<Reading>(reader);
  elapsed_us_ = reader.get<std::int64_t>();
  base_ = reader.get<TimeNs>();
  hour_ = get_optional<TimeNs>(reader);
  hour_counter_us_ = reader.get<std::uint32_t>();
}

}  // namespace understory
