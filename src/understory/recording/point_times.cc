#include "understory/recording/point_times.h"
#include "understory/recording/recording_constants.h"
#include "understory/util/median.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>

namespace understory {
namespace {

using namespace recording_constants::point_times;

std::string unit_name(double unit) {
  if (unit == 1.0) return "s";
  if (unit == 1e-3) return "ms";
  return unit == 1e-6 ? "us" : "ns";
}

// Seconds between scans, 0 if unknown.
double scan_period(const std::vector<CloudTimes>& clouds) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < clouds.size(); ++i) {
    const double step = to_seconds(clouds[i].stamp - clouds[i - 1].stamp);
    if (step > 1e-4 && step < 10.0) steps.push_back(step);
  }
  return steps.empty() ? 0.0 : upper_median(steps);
}

double raw_span(const std::vector<CloudTimes>& clouds) {
  std::vector<double> spans;
  for (const CloudTimes& cloud : clouds)
    spans.push_back(cloud.high - cloud.low);
  return upper_median(spans);
}

// The unit in which the clouds last about as long as the time between them: hardly longer, but much
// shorter where scans are left out.
std::optional<double> fitting_unit(double span, double period) {
  const double expected = period > 0.0 ? period : kUsualPeriod;
  for (const double unit : {1.0, 1e-3, 1e-6, 1e-9}) {
    const double share = span * unit / expected;
    if (share <= kLongest) return share > 1e-3 * kLongest ? std::optional(unit) : std::nullopt;
  }
  return std::nullopt;
}

// Whether all values lie close to zero, as offsets do.
bool near_zero(const std::vector<CloudTimes>& clouds, double span) {
  return std::all_of(clouds.begin(), clouds.end(), [&](const CloudTimes& cloud) {
    return std::max(std::abs(cloud.low), std::abs(cloud.high)) <= 3.0 * span;
  });
}

// How long after the IMU's messages of the same stamp the clouds came, seconds. Nothing if the log
// times are copies of the stamps and so tell nothing.
std::optional<double> delay_behind_imu(const std::vector<CloudTimes>& clouds,
                                       const std::vector<TimeNs>& imu_delays) {
  std::vector<TimeNs> delays;
  for (const CloudTimes& cloud : clouds)
    delays.push_back(cloud.log_time - cloud.stamp);
  const auto tells_nothing = [](TimeNs delay) { return std::abs(delay) < kNoDelay; };
  if (delays.size() < kCloudsForDelay || imu_delays.size() < kCloudsForDelay) return std::nullopt;
  if (std::all_of(delays.begin(), delays.end(), tells_nothing)) return std::nullopt;
  return to_seconds(upper_median(delays) - upper_median(imu_delays));
}

enum class Arrival { kUnknown, kAfterFullScan, kTooEarly };

Arrival judge_arrival(const std::vector<CloudTimes>& clouds, const std::vector<TimeNs>& imu_delays,
                      double duration) {
  const auto delay = delay_behind_imu(clouds, imu_delays);
  if (!delay || *delay < kEarly * duration) return Arrival::kUnknown;
  if (*delay < kBeforeEnd * duration) return Arrival::kTooEarly;
  return *delay < kLate * duration ? Arrival::kAfterFullScan : Arrival::kUnknown;
}

std::string stamp_text(TimeConvention::Stamp stamp) {
  switch (stamp) {
    case TimeConvention::Stamp::kFirstPoint:
      return "stamp = first point";
    case TimeConvention::Stamp::kLastPoint:
      return "stamp = last point";
    default:
      return "stamp within the scan";
  }
}

// Where the stamp lies, given the first and last point's time relative to it as shares of the scan.
TimeConvention::Stamp stamp_place(double first, double last) {
  if (std::abs(first) <= kSame) return TimeConvention::Stamp::kFirstPoint;
  if (std::abs(last) <= kSame) return TimeConvention::Stamp::kLastPoint;
  return TimeConvention::Stamp::kBetween;
}

TimeConvention without_times(const std::string& why, const std::vector<CloudTimes>& clouds,
                             const std::vector<TimeNs>& imu_delays, double period) {
  TimeConvention result;
  result.text = why;
  result.warning = why + ": the motion within a scan cannot be taken out";
  const double duration = period > 0.0 ? period : kUsualPeriod;
  if (judge_arrival(clouds, imu_delays, duration) == Arrival::kTooEarly) {
    result.stamp = TimeConvention::Stamp::kLastPoint;
    result.shift = -from_seconds(duration);
    result.text += "; stamp = last point (by its time of arrival)";
  } else {
    result.text += "; stamp = first point (assumed)";
  }
  return result;
}

TimeConvention with_offsets(const std::string& name, double unit,
                            const std::vector<CloudTimes>& clouds,
                            const std::vector<TimeNs>& imu_delays, double span) {
  TimeConvention result;
  result.kind = TimeConvention::Kind::kOffset;
  result.unit_s = unit;
  std::vector<double> lows;
  std::vector<double> highs;
  for (const CloudTimes& cloud : clouds) {
    lows.push_back(cloud.low / span);
    highs.push_back(cloud.high / span);
  }
  result.stamp = stamp_place(upper_median(lows), upper_median(highs));
  result.text = name + ": offset in " + unit_name(unit) + " from the header stamp; ";
  std::string how;
  const double duration = span * unit;
  if (result.stamp == TimeConvention::Stamp::kFirstPoint) {
    const Arrival arrival = judge_arrival(clouds, imu_delays, duration);
    if (arrival == Arrival::kAfterFullScan) how = " (arrival times agree)";
    if (arrival == Arrival::kTooEarly) {
      result.stamp = TimeConvention::Stamp::kLastPoint;
      result.shift = -from_seconds(upper_median(highs) * duration);
      how = " although offsets count from the first one";
      result.warning =
          "the clouds arrive before their last points could have been measured: the "
          "header stamp is taken as the time of the last point";
    }
  }
  result.text += stamp_text(result.stamp) + how;
  return result;
}

TimeConvention with_absolute_times(const std::string& name, double unit,
                                   const std::vector<CloudTimes>& clouds, double span) {
  TimeConvention result;
  result.kind = TimeConvention::Kind::kAbsolute;
  result.unit_s = unit;
  std::vector<double> firsts;
  std::vector<double> lasts;
  const double duration = span * unit;
  for (const CloudTimes& cloud : clouds) {
    firsts.push_back(to_seconds(raw_time_to_ns(cloud.low, unit) - cloud.stamp) / duration);
    lasts.push_back(to_seconds(raw_time_to_ns(cloud.high, unit) - cloud.stamp) / duration);
  }
  const double first = upper_median(firsts);
  if (std::abs(first) <= 5.0) {
    result.stamp = stamp_place(first, upper_median(lasts));
    result.text = name + ": absolute, in " + unit_name(unit) + "; " + stamp_text(result.stamp);
    return result;
  }
  char seconds[32];
  std::snprintf(seconds, sizeof seconds, "%.3f", first * duration);
  result.kind = TimeConvention::Kind::kForeignClock;
  result.text = name + ": absolute, in " + unit_name(unit) +
                ", on another clock than the header (" + seconds +
                " s apart); stamp = first point (assumed)";
  result.warning = "the points' times run on another clock than the header stamps (" +
                   std::string(seconds) + " s apart): only their differences are used";
  return result;
}

}  // namespace

TimeNs ns_per_unit(double unit_s) {
  if (unit_s == 1.0) return kNsPerSecond;
  if (unit_s == 1e-3) return 1'000'000;
  return unit_s == 1e-6 ? 1'000 : 1;
}

TimeNs raw_time_to_ns(double raw, double unit_s) {
  constexpr double kLargest = 4.6e18;  // as kLatestTime
  const TimeNs unit_ns = ns_per_unit(unit_s);
  const auto factor = static_cast<double>(unit_ns);
  if (!(std::abs(raw) * factor < kLargest)) return 0;
  // The whole part as an integer: an absolute time in nanoseconds does not fit a double.
  const auto whole = static_cast<TimeNs>(raw);
  const double rest = (raw - static_cast<double>(whole)) * factor;
  return whole * unit_ns + static_cast<TimeNs>(rest + (rest < 0.0 ? -0.5 : 0.5));
}

TimeConvention detect_point_times(const std::string& field, const std::string& type,
                                  const std::vector<CloudTimes>& clouds,
                                  const std::vector<TimeNs>& imu_delays) {
  const double period = scan_period(clouds);
  if (field.empty()) return without_times("no time per point", clouds, imu_delays, period);
  std::vector<CloudTimes> told;
  for (const CloudTimes& cloud : clouds) {
    if (cloud.high > cloud.low) told.push_back(cloud);
  }
  const std::string name = field + " (" + type + ")";
  if (told.empty())
    return without_times("the times of points are all the same in field " + name, clouds,
                         imu_delays, period);
  const double span = raw_span(told);
  const bool offsets = near_zero(told, span);
  const auto unit = fitting_unit(span, period);
  if (!unit) return without_times(name + " fits no unit of time", clouds, imu_delays, period);
  return offsets ? with_offsets(name, *unit, told, imu_delays, span)
                 : with_absolute_times(name, *unit, told, span);
}

void put_convention(BinaryWriter& writer, const TimeConvention& convention) {
  writer.put(convention.kind);
  writer.put(convention.unit_s);
  writer.put(convention.stamp);
  writer.put(convention.shift);
  writer.put(convention.text);
  writer.put(convention.warning);
}

TimeConvention get_convention(BinaryReader& reader) {
  TimeConvention convention;
  convention.kind = reader.get_enum(TimeConvention::Kind::kForeignClock);
  convention.unit_s = reader.get<double>();
  convention.stamp = reader.get_enum(TimeConvention::Stamp::kBetween);
  convention.shift = reader.get<TimeNs>();
  convention.text = reader.get_string();
  convention.warning = reader.get_string();
  return convention;
}

}  // namespace understory
