#pragma once

#include <cstddef>
#include <cstdint>

// The fitted and chosen numbers of the layer `calibration` that are no settings. One namespace for
// each file that uses them. A comment gives the unit (none: a plain number), the meaning, and in
// brackets where the number comes from:
//   chosen   by judgement, fitted to nothing
//   bound    by physics, geometry, statistics, memory or time
//   tuned    on the recordings named; where none are, on simulated ones with seeds up to 19
namespace understory::calibration_constants {

namespace allan_deviation {  // calibration/imu_noise/allan_deviation.cc
// Steps in which a window of a long averaging time moves on: more change the result by less than
// its own noise [chosen]
inline constexpr std::size_t kStepsOfAWindow = 8;
// Octaves of the averaging time at most [bound: 2^39 samples are 87 years at 200 Hz]
inline constexpr std::size_t kMostOctaves = 40;
// Windows that a recording holds at least, one after another [bound: two have one difference]
inline constexpr std::uint64_t kFewestWindows = 3;
}  // namespace allan_deviation

namespace noise_fit {  // calibration/imu_noise/noise_fit.cc
// s: shorter averaging times are not fitted [bound: filters inside IMUs are as long]
inline constexpr double kShortestTimeS = 0.1;
// Rounds of the fit at most [bound: time]
inline constexpr int kMostRounds = 100'000;
// Change of a round, as a share, at which the fit ends [chosen: far below the noise]
inline constexpr double kConverged = 1e-9;
// Frequencies of the integral over the spectrum [bound: its error is below 1 %]
inline constexpr int kFrequencies = 4000;
// Standard deviations from zero at which a figure counts as found [chosen]
inline constexpr double kFoundSigmas = 2.0;
}  // namespace noise_fit

namespace standing_watch {  // calibration/imu_noise/standing_watch.cc
// s of one window [chosen]
inline constexpr double kWindowS = 1.0;
// s between two samples that end a stretch [chosen]
inline constexpr double kLongestGapS = 0.5;
// rad/s within a window, root of the sum of the variances: more is motion [bound: noise of MEMS
// gyroscopes is below 0.015 at 200 Hz, and a hand or a step is above 0.1]
inline constexpr double kMostTurning = 0.03;
// m/s^2 within a window, the same: more is motion [bound: engines that idle are below, steps and
// hands above]
inline constexpr double kMostShaking = 0.5;
// rad/s between the mean of a window and that of the stretch: more is a turn [bound: means over a
// second of noisy IMUs differ by less than 0.005]
inline constexpr double kMostTurn = 0.01;
// m/s^2 between the mean of a window and that of the stretch: more is a new tilt [bound: 0.6
// degrees of tilt]
inline constexpr double kMostTilt = 0.1;
// Share of a new window in the mean of the stretch, which follows a slow drift [chosen]
inline constexpr double kFollow = 1.0 / 30.0;
}  // namespace standing_watch

namespace imu_noise_calibration {  // calibration/imu_noise/imu_noise_calibration.cc
// s of standing at least: less has no figure but the white noise, and that badly [chosen]
inline constexpr double kShortestS = 60.0;
// Intervals between samples whose median is the rate [chosen]
inline constexpr std::size_t kRateIntervals = 1000;
// Share of the samples that may be lost: more changes the white noise by over 1 % [bound: its
// density goes with the root of the rate]
inline constexpr double kMostLost = 0.02;
}  // namespace imu_noise_calibration

}  // namespace understory::calibration_constants
