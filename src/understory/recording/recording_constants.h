#pragma once

#include <cstddef>
#include <cstdint>

// The fitted and chosen numbers of the layer `recording` that are no settings, which stand in the
// Config structs. One namespace for each file that uses them. A comment gives the unit (none: a
// plain number), the meaning, and in brackets where the number comes from:
//   chosen   by judgement, fitted to nothing
//   bound    by physics, geometry, statistics, memory or time
//   tuned    on the recordings named; where none are, on simulated ones with seeds up to 19
//   probed   what a fifth less and a quarter more change, docs/method/constants.md
// or real clouds and measurements by their page.
namespace understory::recording_constants {

// Pairs of positions by which it is told that most are not as far apart as the antennas, before the
// end of the recording; recording/messages/two_receivers.cc [chosen: four seconds at five a second]
inline constexpr std::uint64_t kEnoughPairs = 20;

namespace baseline_headings {  // recording/messages/baseline_headings.cc
// m: antennas that are nearer tell no heading [bound: a centimetre is six degrees there]
inline constexpr double kShortestM = 0.1;
// Last distances by which their scatter is told [chosen: ten seconds at five a second]
inline constexpr std::size_t kLastDistances = 50;
// Distances before the first heading [chosen: a median of fewer is chance]
inline constexpr std::size_t kFewestDistances = 5;
// Most by which a pair's distance, and the scatter of all, may be off, as a share of the antennas'
// distance. A heading by chance is 20 degrees off there [chosen]
inline constexpr double kMostShare = 0.3;
// Standard deviations beyond which a distance is wrong [chosen]
inline constexpr double kFarDistance = 4.0;
// m: standard deviation of a distance at least: phase centres and the rig's own survey [chosen]
inline constexpr double kLeastSdM = 0.005;
// Part of a line that lies in the plane, for a heading: 60 degrees steep at most [chosen]
inline constexpr double kLeastInPlane = 0.5;
// degrees: of a heading that tells nothing [bound: a quarter of a turn]
inline constexpr double kMostSdDeg = 90.0;
// Positions that are kept for the times between them [bound: two on each side]
inline constexpr std::size_t kLastPositions = 4;
// ns: stamps of one moment [bound: clocks that are printed to a millisecond]
inline constexpr std::int64_t kSameMoment = 1'000'000;
// ns: stamps of one epoch whose messages are stamped as they come [chosen: as for sentences]
inline constexpr std::int64_t kSameEpoch = 25'000'000;
// ns: from one position to the next, for the straight line between them; a carrier that sways by
// 1 m/s^2 is off it by a centimetre [chosen]
inline constexpr std::int64_t kLongestPositionStep = 250'000'000;
}  // namespace baseline_headings

namespace imu_axes {  // recording/imu_axes.cc
// ns over which forces and turns are summed [probed: x 0.8 no verdict on 2 of 6 recordings; x 1.25
// on 1]
inline constexpr std::int64_t kTiltWindow = 500'000'000;
// ns between two samples at most [probed: no byte]
inline constexpr std::int64_t kLongestSampleStep = 100'000'000;
// rad^2: sum of squared tilts below which no verdict is given, about ten tilts by 8 degrees
// [probed: x 0.8 no byte; x 1.25 no verdict on 1 of 6 recordings]
inline constexpr double kEnoughTilt = 0.2;
// Share of the squared tilts that axes leave unexplained at most [probed: no byte]
inline constexpr double kGoodFit = 0.4;
// Share of what the axes as they are leave unexplained: other axes have to leave less [probed: no
// byte]
inline constexpr double kFarBetter = 0.5;
// The same among other axes [bound: rounding]
inline constexpr double kBetter = 0.98;
// Change of up over three windows that is a tilt at least [probed: no byte]
inline constexpr double kLeastTilt = 0.05;
// The same at most: turns are small angles [probed: no byte]
inline constexpr double kMostTilt = 0.7;
// Share by which the force may change its length over a tilt [probed: no byte]
inline constexpr double kSameForce = 0.1;
}  // namespace imu_axes

namespace point_times {  // recording/point_times.cc
// s between scans where nothing tells it [chosen: 10 scans a second]
inline constexpr double kUsualPeriod = 0.1;
// Share of a scan's duration within which two times are the same [probed: no byte]
inline constexpr double kSame = 0.15;
// ns: a smaller delay of arrival is none: log times are copies of stamps [bound: rounding]
inline constexpr std::int64_t kNoDelay = 1'000;
// Clouds, and messages of the IMU, that tell a delay at least [probed: no byte]
inline constexpr std::size_t kCloudsForDelay = 4;
// Periods that a scan lasts at most in a unit that fits [probed: no byte]
inline constexpr double kLongest = 3.0;
// Durations of a scan after the IMU: earlier clouds tell nothing [probed: no byte]
inline constexpr double kEarly = -0.5;
// Durations of a scan after the IMU: earlier clouds came before their end [probed: no byte]
inline constexpr double kBeforeEnd = 0.6;
// Durations of a scan after the IMU: later clouds tell nothing [probed: no byte]
inline constexpr double kLate = 5.0;
}  // namespace point_times

namespace scan_merger {  // recording/lidars/scan_merger.cc
// ns from one common scan to the next, where no lidar gives two scans [chosen: 10 scans a second]
inline constexpr std::int64_t kUsualPeriodNs = 100'000'000;
// ns: the same at least [chosen: 50 scans a second, more than any spinning lidar]
inline constexpr std::int64_t kShortestPeriod = 20'000'000;
// ns: the same at most [chosen: one scan a second, less than any spinning lidar]
inline constexpr std::int64_t kLongestPeriod = 1'000'000'000;
// Scans by which the period is told [chosen: the first may be a part of a turn]
inline constexpr std::size_t kScansForPeriod = 3;
}  // namespace scan_merger

namespace merged_lidars {  // recording/lidars/merged_lidars.cc
// ns without a scan after which a lidar is silent, and its scans are not waited for; as
// judgement.max_unused_s [chosen]
inline constexpr std::int64_t kSilence = 1'000'000'000;
// ns between scans from which on a stamp has to be confirmed by the next one [chosen]
inline constexpr std::int64_t kJump = 10'000'000'000;
// Events of other sensors that wait for a scan at most [chosen: seconds of any IMU]
inline constexpr std::size_t kMostWaiting = 5'000;
// Points at least by which the ranges of a lidar are told [chosen]
inline constexpr std::size_t kFewestRanges = 10;
// m: half of the points of a lidar are nearer [chosen: no forest is looked at from so far away; in
// centimetres half of the points are beyond]
inline constexpr float kFarthestMedianM = 300.0F;
// Lidars in one scan [bound: their rings are counted by 16 bits]
inline constexpr std::size_t kMostLidars = 16;
}  // namespace merged_lidars

}  // namespace understory::recording_constants
