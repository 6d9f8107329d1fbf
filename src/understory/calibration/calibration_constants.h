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

namespace path_and_imu {  // calibration/lidar_imu/path_and_imu.cc
// Poses of a run at least [bound: statistics of its frequencies]
inline constexpr std::size_t kFewestPoses = 30;
// Poses of a run at most [bound: time, which grows with the square]
inline constexpr std::size_t kMostPoses = 1000;
// s between two scans of a run at most [chosen]
inline constexpr double kLongestStepS = 0.5;
// Step of a numerical derivative: rad, m, rad/s, m/s^2 [bound: rounding and curvature]
inline constexpr double kDerivativeStep = 1e-5;
// s: the same of the lateness [bound: half a sample's interval at 1 kHz]
inline constexpr double kLatenessStepS = 5e-4;
}  // namespace path_and_imu

namespace coloured_fit {  // calibration/lidar_imu/coloured_fit.cc
// Frequencies to each side over which the power of the errors is averaged [chosen: 60 numbers of
// three axes make a mean good to 13 %]
inline constexpr std::int64_t kReach = 10;
// Rounds of the fit of the law of the errors [bound: shares change by less than 1 % after these]
inline constexpr int kLawRounds = 3000;
// Power of errors at least: a signal without errors has no information beyond [bound: rounding]
inline constexpr double kLeastPower = 1e-24;
}  // namespace coloured_fit

namespace lidar_imu_calibration {  // calibration/lidar_imu/lidar_imu_calibration.cc
// s of path with samples at least [chosen]
inline constexpr double kShortestPathS = 10.0;
// Rounds of the fit at most [bound: time]
inline constexpr int kMostFitRounds = 30;
// Standard deviations of the last step of a fit [chosen: far below the errors]
inline constexpr double kConvergedSigmas = 0.01;
// s of lateness beside the given one at most [chosen]
inline constexpr double kMostLatenessS = 0.3;
// s to each side of the given lateness that are searched first [chosen]
inline constexpr double kSearchS = 0.25;
// s from one searched lateness to the next [bound: the fit converges from tens of milliseconds]
inline constexpr double kSearchStepS = 0.025;
// rad^2 about the second axis, sum over all steps: less turning is not searched [bound: noise of
// scan matching, 0.1 degrees over 1000 steps, is 0.003]
inline constexpr double kEnoughTurning = 0.01;
// rad: standard deviation of the given rotation in the fit [chosen: weak]
inline constexpr double kGivenRotation = 0.5;
// m: the same of the place [chosen: weak]
inline constexpr double kGivenPlaceM = 2.0;
// s: the same of the lateness [chosen: weak]
inline constexpr double kGivenLatenessS = 0.1;
// rad/s: the same of the gyroscope's bias, about 0 [bound: data sheets of MEMS gyroscopes]
inline constexpr double kGivenGyroBias = 0.06;
// m/s^2: the same of the accelerometer's bias [bound: data sheets of MEMS accelerometers]
inline constexpr double kGivenAccelBias = 0.3;
// m/s^2: the same of gravity, each axis [chosen: weak, its direction is that of the path's frame]
inline constexpr double kGivenGravity = 1.0;
// Standard deviation of scale and axes of gyroscope and accelerometer, each entry [bound: data
// sheets of calibrated MEMS IMUs tell 0.03 to 0.05 degrees and 0.05 to 0.1 %]
inline constexpr double kGivenAxes = 5e-4;
// Standard deviation of the bends of a path [tuned: handheld, seeds 0, 1, 19: -0.09]
inline constexpr double kGivenBend = 0.2;
// rad: standard deviation beyond which a rotation is not told by the recording [chosen: 1 degree]
inline constexpr double kMostRotation = 0.01745;
// m: the same of the place [chosen]
inline constexpr double kMostPlaceM = 0.1;
// s: the same of the lateness [chosen]
inline constexpr double kMostLatenessSdS = 0.005;
// Times the covariance: errors of matching are not the same at all times, as the fit takes them to
// be [tuned: handheld by VLP-16, 60 s, deskewed by the IMU, seeds 1, 2, 4, 5, 6, 102, 103, 109,
// 114, 120: squared errors over the variance were 1.34]
inline constexpr double kPathsAreWorse = 1.3;
// Information about what is kept: far above all that a recording tells [bound: rounding]
inline constexpr double kKept = 1e14;
}  // namespace lidar_imu_calibration

namespace clock_check {  // calibration/lidar_imu/clock_check.cc
// Steps from scan to scan of a stretch at most [bound: time of the fit, which grows with the
// square; 25 s at 10 Hz]
inline constexpr std::size_t kStretchSteps = 250;
// Steps of a stretch at least [bound: statistics of its frequencies]
inline constexpr std::size_t kFewestSteps = 60;
// Stretches that are kept [bound: 140 kB in a checkpoint; more hardly change the errors]
inline constexpr std::size_t kStretches = 4;
// s between two scans of a stretch at most [chosen: as for calibrations]
inline constexpr double kLongestCheckedStepS = 0.5;
// s to each side of the middle of a scan over which its turn rate is averaged [bound: some samples
// at 100 Hz]
inline constexpr double kRateWindowS = 0.015;
// s for which samples are kept at most [chosen: far above two steps]
inline constexpr double kMemoryS = 3.0;
// s of stretches at least [chosen: as for calibrations]
inline constexpr double kShortestCheckedS = 10.0;
// s: lateness above which a run tells it [chosen: below, results hardly change]
inline constexpr double kTellLatenessS = 0.005;
// rad: turn of the axes above which a run tells it [chosen: 1 degree]
inline constexpr double kTellTurnRad = 0.01745;
// Standard deviations from none at which they are told [chosen: a false alarm costs trust]
inline constexpr double kTellSigmas = 4.0;
// s: standard deviation of a lateness beyond which nothing is said of it [chosen]
inline constexpr double kMostToldSdS = 0.01;
}  // namespace clock_check

namespace online_calibration {  // calibration/lidar_imu/online_calibration.cc
// s of a window [chosen: a walk of this length tells the lateness to 1 ms and the rotation to 0.1
// degrees]
inline constexpr double kFitWindowS = 20.0;
// Times the covariance of a window: it has few residuals for its many unknowns [tuned: handheld by
// VLP-16, 60 s, seeds 1, 2, 5, 102, 109, 120: squared errors over the variance were 1.7 without it]
inline constexpr double kWindowsAreWorse = 1.3;
// s that samples reach beyond the poses [bound: the lateness in reach of a fit, and a sample]
inline constexpr double kMarginS = 0.35;
// Squared limits of what counts as told; a smaller variance is that of a value that is kept [bound:
// a value that is kept has 1e-9, and 0.01 of a limit is 1e-4]
inline constexpr double kKeptVariance = 1e-7;
// Standard deviations from the given values at which others are taken [chosen]
inline constexpr double kTakeSigmas = 3.0;
// rad: a smaller turn is not worth mapping anew [chosen: half of what a calibration is good to]
inline constexpr double kTakeTurnRad = 8.7e-4;
// m: the same of the place [as kTakeTurnRad]
inline constexpr double kTakePlaceM = 0.01;
// s: the same of the lateness [as kTakeTurnRad]
inline constexpr double kTakeLatenessS = 5e-4;
}  // namespace online_calibration

}  // namespace understory::calibration_constants
