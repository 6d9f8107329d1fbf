#pragma once

#include <cstddef>
#include <cstdint>

// The fitted and chosen numbers of the layer `recording` that are no settings, which stand in the
// Config structs. One namespace for each file that uses them. A comment gives the unit (none: a
// plain number), the meaning, and in brackets where the number comes from:
//   chosen   by judgement, fitted to nothing
//   bound    by physics, geometry, statistics, memory or time
//   tuned    on the recordings named; where none are, on simulated ones with seeds up to 19
//   not recorded   in use for long, and nothing tells why it is this number
// or real clouds and measurements by their page.
namespace understory::recording_constants {

namespace imu_axes {  // recording/imu_axes.cc
// ns over which forces and turns are summed [not recorded]
inline constexpr std::int64_t kTiltWindow = 500'000'000;
// ns between two samples at most [not recorded]
inline constexpr std::int64_t kLongestSampleStep = 100'000'000;
// rad^2: sum of squared tilts below which no verdict is given, about ten tilts by 8 degrees [not
// recorded]
inline constexpr double kEnoughTilt = 0.2;
// Share of the squared tilts that axes leave unexplained at most [not recorded]
inline constexpr double kGoodFit = 0.4;
// Share of what the axes as they are leave unexplained: other axes have to leave less [not
// recorded]
inline constexpr double kFarBetter = 0.5;
// The same among other axes [bound: rounding]
inline constexpr double kBetter = 0.98;
// Change of up over three windows that is a tilt at least [not recorded]
inline constexpr double kLeastTilt = 0.05;
// The same at most: turns are small angles [not recorded]
inline constexpr double kMostTilt = 0.7;
// Share by which the force may change its length over a tilt [not recorded]
inline constexpr double kSameForce = 0.1;
}  // namespace imu_axes

namespace point_times {  // recording/point_times.cc
// s between scans where nothing tells it [chosen: 10 scans a second]
inline constexpr double kUsualPeriod = 0.1;
// Share of a scan's duration within which two times are the same [not recorded]
inline constexpr double kSame = 0.15;
// ns: a smaller delay of arrival is none: log times are copies of stamps [bound: rounding]
inline constexpr std::int64_t kNoDelay = 1'000;
// Clouds, and messages of the IMU, that tell a delay at least [not recorded]
inline constexpr std::size_t kCloudsForDelay = 4;
// Periods that a scan lasts at most in a unit that fits [not recorded]
inline constexpr double kLongest = 3.0;
// Durations of a scan after the IMU: earlier clouds tell nothing [not recorded]
inline constexpr double kEarly = -0.5;
// Durations of a scan after the IMU: earlier clouds came before their end [not recorded]
inline constexpr double kBeforeEnd = 0.6;
// Durations of a scan after the IMU: later clouds tell nothing [not recorded]
inline constexpr double kLate = 5.0;
}  // namespace point_times

}  // namespace understory::recording_constants
