#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "understory/util/files/binary_io.h"
#include "understory/util/time.h"

namespace understory {

// How the times of the points of a cloud are to be understood.
struct TimeConvention {
  enum class Kind {
    kNone,          // no times, or times that say nothing
    kOffset,        // relative to the header stamp
    kAbsolute,      // on the clock of the header stamp
    kForeignClock,  // absolute on another clock: only differences are used
  };
  enum class Stamp { kFirstPoint, kLastPoint, kBetween };

  Kind kind = Kind::kNone;
  double unit_s = 1e-9;              // 1, 1e-3, 1e-6 or 1e-9
  Stamp stamp = Stamp::kFirstPoint;  // where in the scan the header stamp lies
  // How much later than the header stamp the point of offset zero really was. It is minus a scan's
  // duration where the stamp is that of the last point and offsets count from the first.
  TimeNs shift = 0;
  std::string text;     // for `info`: "offset in ns from the header stamp; stamp = first point"
  std::string warning;  // empty if there is nothing to worry about
};

// A convention of times in the bytes of checkpoints, and back.
void put_convention(BinaryWriter& writer, const TimeConvention& convention);
[[nodiscard]] TimeConvention get_convention(BinaryReader& reader);

// What one cloud tells about its times.
struct CloudTimes {
  TimeNs stamp = 0;     // of the header
  TimeNs log_time = 0;  // when it was recorded
  double low = 0.0;     // smallest and largest raw value; equal if there are none
  double high = 0.0;
};

// Judges the first clouds of a topic together: unit, offset or absolute, and whether the header
// stamp is the first or the last point. `imu_delays` are log time - stamp of IMU messages of the
// same stretch. If a scan's last point would lie after its arrival, seen on the IMU's clock, the
// stamp is that point's. `field` and `type` name the time field ("t", "uint32"), empty if there is
// none. Deterministic; any numbers are valid.
[[nodiscard]] TimeConvention detect_point_times(const std::string& field, const std::string& type,
                                                const std::vector<CloudTimes>& clouds,
                                                const std::vector<TimeNs>& imu_delays);

// 1, 1e-3, 1e-6 and 1e-9 s in nanoseconds.
[[nodiscard]] TimeNs ns_per_unit(double unit_s);
// A raw time as nanoseconds, 0 if it is not a number or beyond the year 2110. Exact for integers
// and for absolute seconds as far as a double is.
[[nodiscard]] TimeNs raw_time_to_ns(double raw, double unit_s);

}  // namespace understory
