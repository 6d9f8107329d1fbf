#pragma once

#include <cstdint>
#include <optional>

#include "understory/util/files/binary_io.h"
#include "understory/util/time.h"

namespace understory {

// Makes absolute time from a counter of microseconds since the hour and the stamps that its packets
// were received with. See VelodyneDecoder for the rules. Not thread-safe.
class VelodyneClock {
 public:
  enum class Source {
    kNone,      // no packet yet
    kPosition,  // hour from a position packet
    kStamp,     // hour from the stamp: the two agree within a second
    kFree,      // the counter is unrelated to UTC: offset from the stamps, smoothed
  };

  // Absolute time of a counter value. Nothing if the value is impossible or jumps against the
  // stamps, unless the packet before it jumped in the same way.
  [[nodiscard]] std::optional<TimeNs> time(std::uint32_t counter_us, TimeNs stamp);
  // A position packet: its own counter and the UTC time of its sentence. False (and nothing
  // changes) if the two do not belong together, that is, the sensor has no pulse per second.
  bool set_utc(std::uint32_t counter_us, TimeNs utc);

  [[nodiscard]] Source source() const { return source_; }

  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  [[nodiscard]] bool follows(std::uint32_t counter_us, TimeNs stamp, std::uint32_t before_us,
                             TimeNs before_stamp) const;
  void anchor(TimeNs stamp);

  struct Reading {
    std::uint32_t counter_us = 0;
    TimeNs stamp = 0;
  };
  Source source_ = Source::kNone;
  std::optional<Reading> last_;
  std::optional<Reading> jumped_;  // the last packet, if it did not follow
  std::int64_t elapsed_us_ = 0;    // counter without the wrap at the hour
  TimeNs base_ = 0;                // absolute time at elapsed 0
  std::optional<TimeNs> hour_;     // start of the hour that hour_counter_us_ belongs to
  std::uint32_t hour_counter_us_ = 0;
};

}  // namespace understory
