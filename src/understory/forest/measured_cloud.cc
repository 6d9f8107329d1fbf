#include "understory/forest/measured_cloud.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace understory {
namespace {

constexpr double kBeyondPath = 1.0;  // s

}  // namespace

double ScannerPath::range_m(const TimedPoint& point) const {
  if (places_.empty() || !(point.time_s >= places_.front().time_s - kBeyondPath) ||
      !(point.time_s <= places_.back().time_s + kBeyondPath))
    return std::numeric_limits<double>::quiet_NaN();
  const auto after =
      std::lower_bound(places_.begin(), places_.end(), point.time_s,
                       [](const TimedPoint& at, double time_s) { return at.time_s < time_s; });
  if (after == places_.begin()) return (point.place - after->place).norm();
  const TimedPoint& before = *(after - 1);
  if (after == places_.end()) return (point.place - before.place).norm();
  const double share = (point.time_s - before.time_s) / (after->time_s - before.time_s);
  return (point.place - before.place - share * (after->place - before.place)).norm();
}

}  // namespace understory
