#pragma once

#include <cstddef>
#include <cstdint>
#include <numbers>

#include "understory/util/time.h"

// The fitted and chosen numbers of the layer `odometry` that are no settings, which stand in the
// Config structs. One namespace for each file that uses them. A comment gives the unit (none: a
// plain number), the meaning, and in brackets where the number comes from:
//   chosen   by judgement, fitted to nothing
//   bound    by physics, geometry, statistics, memory or time
//   tuned    on the recordings named; where none are, on simulated ones with seeds up to 19
//   probed   what a fifth less and a quarter more change, docs/method/constants.md
//   not recorded   in use for long, and nothing tells why it is this number
// or real clouds and measurements by their page.
namespace understory::odometry_constants {

// rad a degree [mathematics]
inline constexpr double kRadPerDegree = std::numbers::pi / 180.0;

namespace sight_noise {  // odometry/stems/sight_noise.cc
// Pairs of changes before they tell: chance then leaves 0.05 of the correlation [bound: 1/sqrt(n)]
inline constexpr double kEnoughPairs = 400.0;
// Share of what was told that is left after a view: some 50 views count [chosen]
inline constexpr double kKept = 0.98;
// Correlation of changes that oppose each other: with less the newest sight counts alone. Errors
// that go along with the view are then as large as noise, and sights from elsewhere do not agree
// with it. Real views have 0.02, with half of their stems missing 0.08, with 10 cm of noise 0.35 in
// the mean [data/wild_places_v03: with 0.1 the undisturbed path is 0.03 m worse in the plane]
inline constexpr double kLeastOpposed = 0.25;
// m of noise in the plane from which sights are averaged: any [chosen]
inline constexpr double kLeastNoiseInPlaneM = 0.0;
// m of noise of heights from which they are averaged. Guessed feet err by 9 cm, and the error goes
// along with the distance. Averages of them bend a path in height [tuned on simulated roads]
inline constexpr double kLeastNoiseInHeightM = 0.15;
// Share of the newest sight at the least, as errors of the pose go along, too [chosen]
inline constexpr double kLeastGain = 0.05;
}  // namespace sight_noise

namespace trust_monitor {  // odometry/dense/trust_monitor.cc
// rad of one turn that stands out from the noise of matching [chosen]
inline constexpr double kSmallestTurn = 0.3 * kRadPerDegree;
// rad in all before a verdict on the axes [chosen]
inline constexpr double kEnoughTurning = 30.0 * kRadPerDegree;
// Turns before a verdict on the axes [chosen]
inline constexpr int kEnoughTurns = 10;
// rad in all before a verdict without a cause [chosen]
inline constexpr double kEnoughUnexplained = 120.0 * kRadPerDegree;
// s that an IMU stays on probation [chosen]
inline constexpr double kLongestProbationS = 20.0;
// s of a turn while on probation [chosen]
inline constexpr double kProbationTurnS = 0.5;
// rad/s of a gyroscope's bias that is taken out [bound: data sheets of MEMS gyroscopes]
inline constexpr double kLargestBias = 0.06;
// Share of the turning that is unexplained: above it something is wrong [chosen]
inline constexpr double kBad = 0.4;
// Share of the turning that is unexplained: below it all is well [chosen]
inline constexpr double kGood = 0.25;
// Times the lidar's turning, which has noise of its own; 57.3 is exact [chosen]
inline constexpr double kLooksLikeDegrees = 20.0;
// The same as kGood on probation: a lidar alone is less sure of its turns [chosen]
inline constexpr double kGoodOnProbation = 0.3;
// rad between axes beyond any noise [chosen]
inline constexpr double kSurelyTurned = 20.0 * kRadPerDegree;
// Of the squares that other axes leave: they are the right ones [chosen]
inline constexpr double kMuchBetter = 0.25;
// Times the squares of the best axes: as good as these [chosen]
inline constexpr double kAsGood = 1.5;
// s of gravity before a verdict: walking and driving swing it by a few degrees [chosen]
inline constexpr int kEnoughSeconds = 10;
// s before a verdict on the length of gravity [chosen]
inline constexpr int kEnoughForLength = 3;
// s before a verdict while on probation [chosen]
inline constexpr int kEnoughForProbation = 4;
// rad between the gravity of seconds: more is no gravity [chosen]
inline constexpr double kForceSpread = 15.0 * kRadPerDegree;
// rad: the same of an accelerometer that was suspected before [chosen]
inline constexpr double kSuspectSpread = 5.0 * kRadPerDegree;
// Share by which gravity's length may be off [bound: scale errors of accelerometers are below 2
// %]
inline constexpr double kLengthTolerance = 0.15;
}  // namespace trust_monitor

namespace imu_watch {  // odometry/imu/imu_watch.cc
// rad, standard deviation of a turn by two matches: beyond, it says nothing of the gyroscope.
// Matches with some uprights have 0.02 [chosen: a scan turns by up to 0.1 in a tenth of a second]
inline constexpr double kUncertainTurn = 0.08;
}  // namespace imu_watch

namespace recovery {  // odometry/dense/recovery.cc
// s without a scan that are an outage [chosen]
inline constexpr double kOutageS = 1.0;
// Of the usual inliers, needed after an outage [chosen]
inline constexpr double kFoundAgainShare = 0.5;
// m: a prediction less certain is no better than staying where one was [chosen]
inline constexpr double kWorthlessSigmaM = 10.0;
// m: after a blind time, a prediction less certain does not wait for a better scan [chosen]
inline constexpr double kCertainSigmaM = 1.0;
// scans that it waits for: the first one sees part of a turn [chosen]
inline constexpr std::uint32_t kWaitedScans = 5;
// m/s: no carrier is faster [bound: carriers]
inline constexpr double kHighestSpeedMPerS = 100.0;
}  // namespace recovery

namespace scan_path {  // odometry/dense/scan_path.cc
// Slices of a scan's time; within one, all points share a correction [chosen]
inline constexpr std::size_t kSlices = 8;
// points of a slice that counts [chosen]
inline constexpr std::size_t kFewestPoints = 20;
}  // namespace scan_path

namespace scan_motion {  // odometry/dense/scan_motion.cc
// m at which a turn counts as a shift [chosen]
inline constexpr double kRangeM = 10.0;
// m within a scan: less tells nothing of its times [chosen]
inline constexpr double kLeastMotionM = 0.08;
// s between two scans: more is no even motion [chosen]
inline constexpr double kLongestStepS = 0.5;
}  // namespace scan_motion

namespace lidar_agreement {  // odometry/dense/lidar_agreement.cc
// m/s: slower motion tells nothing of clocks [chosen]
inline constexpr double kLeastSpeed = 0.2;
// s between two scans: more is no even motion [chosen]
inline constexpr double kLongestEvenStepS = 0.5;
// Scans at least that tell where a lidar's points lie [chosen]
inline constexpr int kFewestProbes = 8;
// Components of a motion [bound: turn and shift]
inline constexpr double kComponents = 6.0;
// Values that are estimated from these [bound: a constant each, and one clock]
inline constexpr double kParameters = 7.0;
// s: a clock that is off by less is not told [chosen: as that of the IMU]
inline constexpr double kLeastLateS = 0.005;
// m: points that lie apart by less are not told [chosen: 5 standard deviations of good recordings
// of harvester2]
inline constexpr double kLeastMisplacedM = 0.015;
// Standard deviations of a clock that are sure [chosen: as for the IMU's clock]
inline constexpr double kSureClockSds = 4.0;
// The same of the points' place, whose standard deviation is that of six components together
// [chosen: chance alone does not reach it]
inline constexpr double kSurePlaceSds = 3.0;
}  // namespace lidar_agreement

namespace dense_odometry {  // odometry/dense/dense_odometry.cc
// Of the accelerations that the motion model allows for between scans: a path that may bend more
// within one follows the noise of sparse scans [chosen]
inline constexpr double kBendShare = 1.0 / 3.0;
// Share of a new scan in the running mean of inliers [chosen]
inline constexpr double kFollow = 0.1;
}  // namespace dense_odometry

namespace start_in_motion {  // odometry/dense/start_in_motion.cc
// s between the two first scans at most [chosen]
inline constexpr double kLongestBetweenS = 0.5;
// m of motion within a scan: less needs no start [chosen]
inline constexpr double kLeastSmearM = 0.005;
// m at which a turn is counted [chosen]
inline constexpr double kSmearRangeM = 10.0;
// Of the second scan's duration or sectors: a first scan with less is a part [chosen]
inline constexpr double kPartShare = 0.75;
}  // namespace start_in_motion

namespace preintegration {  // odometry/imu/preintegration.cc
// Times of a spacing between samples that the next one may be long [chosen: jitter of a clock]
inline constexpr double kEvenSpacing = 1.5;
// s between the samples of a sensor that shows its noise [bound: walking at 8 Hz shows no more than
// the setting of 0.03 m/s^2/sqrt(Hz)]
inline constexpr double kSlowestSpacingS = 0.0105;
// Second differences that show a noise at least [chosen: a tenth of a second at 100 Hz has 8]
inline constexpr int kFewestTriples = 5;
}  // namespace preintegration

namespace imu_smoother {  // odometry/imu/imu_smoother.cc
// rad: the world is levelled once its tilt is known this well [chosen]
inline constexpr double kLevelSigma = 0.1 * kRadPerDegree;
// s: not before [chosen]
inline constexpr double kLevelFirstS = 1.0;
// s: or after this long [chosen]
inline constexpr double kLevelLastS = 3.0;
// rad: smaller tilts stay [chosen]
inline constexpr double kLevelSmallest = 0.02 * kRadPerDegree;
}  // namespace imu_smoother

namespace initial_state {  // odometry/imu/initial_state.cc
// s at rest that give a first state [chosen]
inline constexpr double kShortestStillS = 0.3;
// rad/s that a tripod, a harness or an idling engine adds to the noise [chosen]
inline constexpr double kVibrationRate = 0.02;
// m/s^2 that they add [chosen]
inline constexpr double kVibrationForce = 0.25;
// rad/s: mean rate at rest at most [bound: data sheets of MEMS gyroscopes]
inline constexpr double kLargestGyroBias = 0.1;
// m/s^2 of the mean's length against gravity [bound: biases of MEMS accelerometers]
inline constexpr double kForceTolerance = 0.5;
// ns before and after a start in motion whose mean force is up [not recorded]
inline constexpr std::int64_t kMotionHalfWindow = 300'000'000;
// Length in the plane below which the x axis is upright and y gives the heading [chosen]
inline constexpr double kUprightAxis = 0.2;
// rad/s: error of the gyroscope's bias at rest at most [not recorded]
inline constexpr double kStillBias = 0.005;
// m/s: error of the velocity at rest [not recorded]
inline constexpr double kStillVelocity = 0.5;
}  // namespace initial_state

namespace window_smoother {  // odometry/imu/window_smoother.cc
// steps a state among the first 30, whose linearisation may be far off [chosen]
inline constexpr int kFirstIterations = 5;
// rad/s: a bias that has moved farther has its motion integrated again; below, the linear
// correction is good to far less than the noise [bound: second order of the correction]
inline constexpr double kGyroBiasShift = 1e-3;
// m/s^2: the same [bound: second order of the correction]
inline constexpr double kAccelBiasShift = 2e-2;
// Units of the tangent: a smaller step has no consequence [bound: rounding]
inline constexpr double kConverged = 1e-7;
}  // namespace window_smoother

namespace motion_scale {  // odometry/motion/motion_scale.cc
// s over which accelerations are compared: three scans at 10 Hz [chosen]
inline constexpr double kWindowS = 0.29;
}  // namespace motion_scale

namespace residual_scale {  // odometry/motion/residual_scale.cc
// Matches before residuals are believed: 2 s at 10 Hz [chosen]
inline constexpr int kFewest = 20;
// Matches over which the mean is taken: 10 s at 10 Hz [chosen]
inline constexpr int kMemory = 100;
// Errors of a scan over the residuals: neighbouring scans share the errors of the local map, which
// residuals do not show [fit: benchmarks/scan_covariance.py, handheld 3 and 4, harvester 3,
// random 8, 9 and 16]
inline constexpr double kShared = 1.2;
// Least factor of a standard deviation [chosen]
inline constexpr double kSmallest = 0.005;
// Largest factor of it [chosen]
inline constexpr double kLargest = 10.0;
}  // namespace residual_scale

namespace stem_front_end {  // odometry/stems/stem_front_end.cc
// s: a longer pause, and what moved before says nothing about now [chosen]
inline constexpr double kLongestStep = 2.0;
// s: a shorter step is a clock that was mended; a speed by it is noise [bound: no lidar takes a
// thousand scans a second]
inline constexpr double kShortestStep = 1e-3;
// Of the time since the last scan: a shorter scan is followed by a pause [probed: x 0.8 no byte; x
// 1.25 no figure]
inline constexpr double kPause = 0.4;
// s before the first scan over which specific force is averaged: a stride of a walk [chosen]
inline constexpr double kFirstForceS = 1.0;
// Cosine between two directions that are tried as up: closer ones find the same stems
// [bound: stems are found with up wrong by 25 degrees]
inline constexpr double kSameUp = 0.99;
// Times the stems that stand along a direction that was tried earlier. The right way up has 1.35 to
// 5 times as many as upside down. [tuned on demo with 16 and 128 rings, lieksa2, harvester, lohja1
// and the walk of tests/bad_input, whose accelerometer may be reversed]
inline constexpr double kMoreStanding = 1.2;
// stems along a direction that is tried later: fewer may be chance [chosen]
inline constexpr std::size_t kFewestStanding = 5;
}  // namespace stem_front_end

namespace stem_imu {  // odometry/stems/stem_imu.cc
// rad/s of the gyroscope [bound: data sheets of MEMS gyroscopes]
inline constexpr double kLargestGyroBias = 0.1;
// rad by which a stand leans as a whole, one standard deviation [chosen]
inline constexpr double kStandLeans = 0.3 * kRadPerDegree;
}  // namespace stem_imu

namespace gathered_scan {  // odometry/stems/gathered_scan.cc, stem_pacer.cc
// ns of the scans that are gathered: a Mid-360 leaves 2.5 degrees between its strokes in a tenth of
// a second [tuned on mid360]
inline constexpr TimeNs kWindow = 500'000'000;
// ns from pose to pose of the path within it [chosen: a walker's turn is even for so long]
inline constexpr TimeNs kPathStep = 10'000'000;
// deg: height of a ring [tuned on mid360, 2 to 6 tried: four points a cell in half a second]
inline constexpr double kRingDeg = 4.0;
// deg: width of a column [tuned on mid360, 0.2 to 0.5 tried]
inline constexpr double kColumnDeg = 0.25;
// of a turn [mathematics]
inline constexpr std::uint32_t kColumns = 1440;
// Points of a cell at least: one alone may be a twig, or an edge [tuned on mid360]
inline constexpr std::size_t kFewestOfACell = 2;
// m about the median range of a cell within which points are of one surface [chosen]
inline constexpr float kSameSurface = 0.15F;
// m from the axis of the lidar: nearer points have no azimuth to speak of [chosen]
inline constexpr double kNearest = 0.3;
// Times that the motion of a window is taken from the match of its own stems [tuned on mid360]
inline constexpr int kRounds = 2;
}  // namespace gathered_scan

namespace stem_levelling {  // odometry/stems/stem_levelling.cc
// degrees of freedom of Student's t, for stems that lean [chosen: heavy tails]
inline constexpr double kFreedom = 3.0;
// length of the mean of the axes from which on they say which end is the upper one [chosen: lines
// whose ends are told at random, ten of them, seldom have 0.7]
inline constexpr double kOneSided = 0.8;
// z of up in the body below which the body hangs over: cosine of 120 degrees [chosen: no mount is
// usual there, so that the heading of level frames seldom leaps]
inline constexpr double kFarOver = -0.5;
}  // namespace stem_levelling

}  // namespace understory::odometry_constants
