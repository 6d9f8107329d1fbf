#pragma once

#include <cstdint>
#include <optional>

#include "understory/util/files/binary_io.h"
#include "understory/util/time.h"

namespace understory {

// Absolute time of packets whose sensor has a clock of its own with date, and which were received
// at known stamps. Where the two agree within a second the sensor's clock is UTC and is used as it
// is. Else (no GNSS, no PTP) its differences are used, and the stamps, smoothed over some ten
// seconds, give the offset. Not thread-safe.
class SensorClock {
 public:
  // Absolute time of a packet. Nothing if its time jumps by more than half a second against the
  // stamps, unless the packet before it jumped in the same way.
  [[nodiscard]] std::optional<TimeNs> time(TimeNs sensor, TimeNs stamp);
  // Whether the sensor's time is used as it is; also before the first packet.
  [[nodiscard]] bool synchronised() const { return !free_; }

  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  struct Reading {
    TimeNs sensor = 0;
    TimeNs stamp = 0;
  };
  static bool follows(const Reading& now, const Reading& before);

  std::optional<Reading> last_;
  std::optional<Reading> jumped_;  // the last packet, if it did not follow
  bool free_ = false;
  TimeNs offset_ = 0;  // absolute time - sensor time
};

}  // namespace understory
