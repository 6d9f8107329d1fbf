#pragma once

#include <cstddef>
#include <cstdint>

// The fitted and chosen numbers of the layer `georeference` that are no settings, which stand in
// the Config structs. One namespace for each file that uses them. A comment gives the unit (none:
// a plain number), the meaning, and in brackets where the number comes from:
//   chosen   by judgement, fitted to nothing
//   bound    by physics, geometry, statistics, memory or time
//   tuned    on the recordings named; where none are, on simulated ones with seeds up to 19
// or real clouds and measurements by their page.
namespace understory::georeference_constants {

namespace interpolation {  // georeference/satellites/: satellite_pairs, satellite_fit,
                           // online_georeference
// s between poses beyond which nothing is interpolated [chosen]
inline constexpr double kGapS = 2.0;
}  // namespace interpolation

namespace satellite_pairs {  // georeference/satellites/satellite_pairs.cc
// Share of the line between two antennas in the plane below which its heading does not count
// [chosen: 60 degrees; a world that is 0.25 degrees off level turns it by 0.43 there]
inline constexpr double kUpright = 0.5;
// Fixes of one interval from which on one is compared with the others [bound: two tell not which]
inline constexpr std::size_t kFewestToCompare = 3;
// m from the median of an interval's fixes beyond which one is left out [chosen: errors below trees
// change slowly, and hardly by 10 m within a second]
inline constexpr double kFarFixM = 10.0;
// Medians of those distances beyond which one is left out as well [chosen: normal errors: one in
// 1e7]
inline constexpr double kFarFixMedians = 8.0;
// Degrees of latitude and longitude from the median of all fixes up to which one may tell the
// origin [chosen: 20 km, more than a day's way on foot]
inline constexpr double kFarOriginDeg = 0.2;
}  // namespace satellite_pairs

namespace satellite_belief {  // georeference/satellites/in_match/satellite_belief.cc
// m: steps of the path that show which way the carrier goes [chosen]
inline constexpr double kCourseStepM = 1.0;
// m/s below which a course of `course_way_m` tells no heading [chosen: slow walking]
inline constexpr double kSlowestCourseMS = 0.4;
// Scans from one that is matched by its points alone to the next [chosen: a fifth of the time of
// matches]
inline constexpr int kProbeEvery = 5;
// Degrees between the way and where the carrier looks, beyond which that tells no heading of the
// map [chosen: a sleigh slips by less]
inline constexpr double kMostSlipDeg = 20.0;
// and by which it turns on that way [chosen: a bend whose radius is three times course_way_m]
inline constexpr double kMostBendDeg = 20.0;
// m from the body's origin beyond which a centre of turning is none [bound: a lidar's range]
inline constexpr double kFarthestCentreM = 50.0;
// Fixes kept for the course, at most [bound: memory]
inline constexpr std::size_t kMostFixes = 2'000;
// A fix whose way since the one before the course's way is off that of the odometry by more
// standard deviations counts less [chosen]
inline constexpr double kFarSteps = 4.0;
// Error of the odometry over that way, m [chosen: ten times that of a good one]
inline constexpr double kOdometryErrorM = 0.03;
// and as a share of it [chosen: ten times that of a good one]
inline constexpr double kOdometryErrorShare = 0.02;
// Share of the distrust that is left at the next fix [chosen: gone after some ten seconds]
inline constexpr double kDistrustKept = 0.95;
// Standard deviation of a fix, its largest axis, up to which it holds the path, m [chosen: RTK]
inline constexpr double kHeldSdM = 0.15;
// and how far the antenna may be from it, m [bound: what shows a stem twice]
inline constexpr double kHeldM = 0.3;
// Heading of a map that positions hold, degrees, one standard deviation [chosen: about what whole
// skidoo, seed 3, has]
inline constexpr double kMapHeadingDeg = 0.3;
// Of a heading by a second antenna whose receiver does not say how good it is, degrees [chosen: as
// for the online georeference]
inline constexpr double kHeadingSdDeg = 0.5;
// How well the line between the antennas is known on the body, degrees [chosen: 5 mm on a metre]
inline constexpr double kBaselineSdDeg = 0.3;
// By how much a map may have turned, degrees; a heading that is farther off does not count [chosen]
inline constexpr double kMostTurnDeg = 5.0;
// m to the points of a heading without a position [bound: 1 m at the antenna counts nothing there]
inline constexpr double kFarArmM = 1000.0;
// Standard deviation of a height that nothing tells, m [chosen: as good as nothing]
inline constexpr double kUnknownM = 1e3;
// and of an angle, rad [chosen: as good as nothing]
inline constexpr double kUnknownRad = 10.0;
}  // namespace satellite_belief

namespace fix_drift {  // georeference/satellites/in_match/fix_drift.cc
// Standard deviations from the path beyond which a fix has left it [chosen]
inline constexpr double kLeavingSteps = 4.0;
// Error of the odometry, m [chosen: ten times that of a good one]
inline constexpr double kOdometryM = 0.03;
// and as a share of the way [chosen: ten times that of whole skidoo, seed 3, in the plane]
inline constexpr double kOdometryShare = 0.003;
// The same for a fix that has left the path: so far it must come back [chosen: a third]
inline constexpr double kReturnShare = 0.001;
// and of a way whose scans were held in some directions only, added [chosen]
inline constexpr double kLooseShare = 0.1;
// m: over such a way the local map follows pulled scans [chosen: what a lidar sees under trees]
inline constexpr double kMapWayM = 30.0;
// m between the fixes that later ones are compared with [chosen]
inline constexpr double kAnchorStepM = 5.0;
// and how many they are [chosen: a hundred metres]
inline constexpr std::size_t kMostAnchors = 20;
// The last few of them are compared by themselves, too [chosen: 25 m]
inline constexpr std::size_t kFewAnchors = 5;
}  // namespace fix_drift

namespace second_antenna {  // georeference/satellites/second_antenna.cc
// Pairs with a heading at least [bound: a median that leaves one out]
inline constexpr std::size_t kFewestHeadings = 3;
// Standard deviations of a heading from those before it beyond which it is left out [chosen]
inline constexpr double kFarHeading = 5.0;
// Headings in a row, that far off, after which they are right [chosen]
inline constexpr std::uint64_t kMostFarHeadings = 30;
// s between pairs, at least [bound: a correlation over no time]
inline constexpr double kShortestStepS = 0.05;
}  // namespace second_antenna

namespace receiver_noise {  // georeference/satellites/receiver_noise.cc
// Unknowns of the noise are in standard deviations of their prior. Rounds of the search for the
// most probable one, at most [bound: time]
inline constexpr int kSearchRounds = 12;
// A step to the vertex of a parabola is at most that many of those that made it [chosen]
inline constexpr double kLongestStep = 2.0;
// The search ends below that step [chosen]
inline constexpr double kShortestStep = 0.2;
// A round that adds less to the logarithm of the density halves the step [chosen]
inline constexpr double kLittle = 0.5;
// Correlation times of the slow error where the search begins [chosen: 150 s and 25 s]
inline constexpr double kStarts[] = {0.0, -2.0};
// Step of the differences that give the curvature [chosen]
inline constexpr double kCurvatureStep = 0.2;
// Curvature at least: that of the prior is 1 [chosen]
inline constexpr double kLeastCurvature = 0.5;
// Draws of the noise [bound: time]
inline constexpr std::size_t kDraws = 160;
// Degrees of freedom of the distribution they are drawn from [chosen: tails wider than normal]
inline constexpr int kFreedom = 5;
// Standard deviations of the prior at which a noise is held [chosen]
inline constexpr double kFarthest = 6.0;
// Seed of the draws: the same pairs give the same result [chosen]
inline constexpr std::uint64_t kSeed = 1;
// Noises that a covariance is the mean over [bound: time]
inline constexpr double kAveragedNoises = 32.0;
// `follows` at most [chosen: twice as bad as stated where four times as bad is stated]
inline constexpr double kMostFollows = 1.5;
// Columns that are made white at once, at most [bound: two axes of four parameters and a residual,
// in blocks of four numbers]
inline constexpr std::ptrdiff_t kMostColumns = 12;
// s: steps between pairs that differ by less are the same [bound: no correlation changes by it]
inline constexpr double kSameStepS = 1e-6;
// Error that is independent from fix to fix over the fast one [chosen: keeps equations regular]
inline constexpr double kWhiteShare = 0.1;
// Standard deviations of the fast error beyond which a pair is a runaway [chosen]
inline constexpr double kFarOff = 4.0;
// Correlation below which two errors are independent [bound: time]
inline constexpr double kLeastCorrelation = 1e-3;
}  // namespace receiver_noise

namespace receiver_filters {  // georeference/satellites/receiver_filters.cc
// Standard deviations of the prior at which an error is held [chosen]
inline constexpr double kFarthest = 6.0;
// `follows` at most [chosen: twice as bad as stated where four times as bad is stated]
inline constexpr double kMostFollows = 1.5;
// A pair counts as at most that many times as good or as bad as the mean says [chosen]
inline constexpr double kMostScale = 10.0;
// Error that is independent from pair to pair over the fast one [chosen: keeps equations regular]
inline constexpr double kWhiteShare = 0.1;
// m: independent error at least [bound: GNSS]
inline constexpr double kLeastErrorM = 0.003;
// Kinds are drawn anew where fewer than this share of them have a say [chosen]
inline constexpr double kRenewShare = 0.3;
// Share of the spread of all kinds by which one is moved at random when it is drawn [tuned]
inline constexpr double kKernel = 0.15;
// Variance of the kinds at least, in units of the prior [bound: keeps the root real]
inline constexpr double kLeastSpread = 1e-6;
// Seed of the draws: the same pairs give the same result [chosen]
inline constexpr std::uint64_t kSeed = 1;
}  // namespace receiver_filters

namespace online_georeference {  // georeference/satellites/online_georeference.cc
// m: standard deviation of the place before the first fix, about that fix [bound: receivers]
inline constexpr double kFarM = 1'000.0;
// degrees: standard deviation of a heading that is told at most [chosen]
inline constexpr double kMostHeadingDeg = 10.0;
// Standard deviations in the plane over those of the filters, for receivers that are of no kind
// [tuned: the four GNSS presets of docs/method/georeference.md, seeds up to 19]
inline constexpr double kCautious = 1.35;
// Steps to the most probable turn [bound: convergence to a microradian]
inline constexpr int kCircleSteps = 5;
// rad: a step at most [chosen]
inline constexpr double kLongestTurn = 0.5;
// Standard deviation of the radius, 1, that a heading tells of cosine and sine [chosen]
inline constexpr double kRadiusSd = 0.1;
// Fixes that wait for a pose, at most; older ones are dropped [bound: memory]
inline constexpr std::size_t kMostWaiting = 2'000;
// m: pairs that are farther off than that, many in a row, are of another place [chosen]
inline constexpr double kElsewhereM = 300.0;
// Pairs in a row, that far off, after which all begins anew [chosen]
inline constexpr std::uint64_t kElsewherePairs = 30;
}  // namespace online_georeference

namespace control_points {  // georeference/control_points.cc
// m: points that are nearer tell no heading [chosen]
inline constexpr double kLeastApartM = 1.0;
// Points that find one blunder [bound: two tell a motion, a third may be the blunder]
inline constexpr std::size_t kFewestForBlunders = 4;
// Median residuals beyond which a point is a blunder [chosen: 5 standard deviations of a length]
inline constexpr double kBlunder = 4.0;
// Steps of the fit [bound: convergence to a micrometre]
inline constexpr int kSteps = 6;
// Coordinates that the error stated before is worth [chosen]
inline constexpr double kPriorCoordinates = 4.0;
}  // namespace control_points

namespace rigid_fits {  // georeference/satellites/rigid_fits.cc
// Pairs of a rigid motion at least [bound: six degrees of freedom]
inline constexpr std::size_t kFewestPairs = 3;
// m: places that are nearer to their middle in the mean are one place [chosen]
inline constexpr double kLeastSpreadM = 0.01;
}  // namespace rigid_fits

namespace fused_path {  // georeference/satellites/fused_path.cc
// m: fast error of a receiver at least: graphs need a width [chosen]
inline constexpr double kLeastErrorM = 0.005;
// m: error in the plane that a receiver states and that is taken as stated, at most [chosen: RTK,
// fixed or float]
inline constexpr double kGoodReceiverM = 0.15;
// Steps of the logarithm of the odometry's scale, from the configured one [chosen: factors of 3]
inline constexpr double kScaleSteps[] = {0.0, 1.1, 2.2, 3.3};
}  // namespace fused_path

namespace combined_place {  // georeference/combined_place.cc
// rad^-2 and m^-2: weight of the first place where no source tells anything [bound: keeps the
// equations regular; 10 km]
inline constexpr double kNothingKnown = 1e-8;
}  // namespace combined_place

namespace split_fit {  // georeference/satellites/split_fit.cc
// degrees, about each level axis: of the vertical by an IMU whose carrier turned through all
// headings [tuned: two runs of 600 m, seed 1, are off by 0.03 and 0.05]
inline constexpr double kLevelSdDeg = 0.05;
// degrees: the same by an accelerometer's bias where the carrier kept its heading [tuned: eight
// straight or short runs, seeds 1 and 3, have 0.17; a bias of 0.05 m/s^2 makes 0.29]
inline constexpr double kBiasTiltSdDeg = 0.25;
// Pairs at least [bound: three parameters in the plane]
inline constexpr std::size_t kFewestPlanePairs = 3;
// m: extent of the path at least [chosen]
inline constexpr double kLeastExtentM = 5.0;
// Steps of the first motion [bound: convergence to a micrometre]
inline constexpr int kFirstSteps = 30;
// Steps of the fit: each takes the noise anew [bound: convergence to a millimetre]
inline constexpr int kSteps = 3;
// Median of an absolute value over the standard deviation [bound: normal distribution]
inline constexpr double kNormalMedian = 0.6745;
// Standard deviations beyond which a pair is a runaway at first [chosen: slow errors of a few
// minutes are no outliers]
inline constexpr double kFarOff = 4.0;
// m: standard deviation of a height that nothing tells [bound: the earth]
inline constexpr double kUnknownHeightM = 1'000.0;
}  // namespace split_fit

namespace satellite_smoothing {  // georeference/satellites/satellite_smoothing.cc
// rad^-2: weight of the first guess of the attitude [bound: keeps the equations regular]
inline constexpr double kAttitudeWeight = 1e-2;
// m/s: of the first velocity [bound: carriers]
inline constexpr double kVelocitySdMS = 10.0;
// s without samples that still is an interval [chosen]
inline constexpr double kLongestGapS = 0.1;
// rad and m: a step below that is the last [chosen]
inline constexpr double kConverged = 1e-6;
}  // namespace satellite_smoothing

namespace satellite_fit {  // georeference/satellites/satellite_fit.cc
// m: root mean square of residuals below which no mistake of the angles is looked for [chosen]
inline constexpr double kLeastMisfitM = 3.0;
// Ratio of residuals below which swapped angles are the right ones [chosen]
inline constexpr double kClearlyBetter = 0.5;
}  // namespace satellite_fit

namespace gnss_fit {  // georeference/satellites/gnss_fit.cc
// Fixes before and after one that tell its direction [chosen]
inline constexpr std::size_t kReach = 12;
// m between these: less tells no direction [chosen]
inline constexpr double kLeastM = 2.0;
// Ratio of the residuals of two motions below which they fit alike [chosen]
inline constexpr double kAlike = 1.3;
// Ratio of their residuals in time below which one of them is right [chosen]
inline constexpr double kClearly = 0.7;
}  // namespace gnss_fit

namespace terrain_fit {  // georeference/terrain_fit.cc
// points over the terrain model at least [bound: six parameters]
inline constexpr std::size_t kLeastPoints = 10;
// m: width of the biweight at least [chosen]
inline constexpr double kLeastTerrainWidthM = 0.05;
}  // namespace terrain_fit

namespace path_fit {  // georeference/path_fit.cc
// degrees: motions that differ by more are different solutions [chosen]
inline constexpr double kOtherDeg = 20.0;
// m: width of the biweight at least [chosen]
inline constexpr double kLeastWidthM = 0.2;
// Correlation of errors below which they count as independent [chosen]
inline constexpr double kNoMore = 0.05;
// Pairs: correlation is looked at no farther [bound: time]
inline constexpr std::size_t kLongestLag = 5'000;
// m: noise of fixes at least, for the heading's error [bound: GNSS]
inline constexpr double kLeastNoiseM = 0.02;
// degrees: the first turn that is tried for the heading's error; doubled until the sum rises
// [chosen]
inline constexpr double kFirstDeg = 0.25;
// degrees: error of a heading at most [bound: nothing is known then]
inline constexpr double kMostDeg = 90.0;
// points of each path at least [bound: three parameters in the plane]
inline constexpr std::size_t kFewestPoints = 3;
// m: extent of each path at least [chosen]
inline constexpr double kLeastExtentM = 5.0;
// m: points of a path within such a cell are one, with their number as weight [chosen]
inline constexpr double kGatheredM = 0.02;
// Cells along the longer path where every heading is tried [bound: time]
inline constexpr double kCoarseCells = 150.0;
// m: such a cell at least [chosen]
inline constexpr double kLeastCoarseM = 1.0;
// Steps of the search from one heading [bound: time]
inline constexpr int kCoarseSteps = 30;
// m: places behind and before along the road from which a search begins again [chosen]
inline constexpr double kSlidesM[] = {-16.0, -8.0, -4.0, -2.0, 2.0, 4.0, 8.0, 16.0};
// Rounds of that at most [chosen]
inline constexpr int kSlideRounds = 4;
// Steps of each of these searches at most [bound: time]
inline constexpr int kSlideSteps = 100;
// A search from beside counts as better if its sum is less than this share [chosen]
inline constexpr double kBetter = 0.999;
// Steps of the shift for a turned path, for the heading's error [bound: time]
inline constexpr int kTurnedSteps = 15;
}  // namespace path_fit

namespace terrain_file {  // georeference/terrain_file.cc
// cells of a region at most: larger than any run [bound: memory]
inline constexpr double kMostCells = 1e8;
}  // namespace terrain_file

namespace tree_match {  // georeference/trees/
// m: a map of trees reaches so far beyond its trees [chosen: three times the distance of trees]
inline constexpr double kCoverM = 16.0;
// m: standard deviation of the bell that smooths the density of trees [tuned]
inline constexpr double kDensitySdM = 12.0;
// Share of the median density that any place of a map has at least [chosen]
inline constexpr double kLeastDensityShare = 0.2;
// m: grid of the places that are searched [bound: time]
inline constexpr double kCellM = 1.0;
// m: error of a place on that grid and of a heading between two steps [bound: geometry]
inline constexpr double kSearchSdM = 0.5;
// m: step of the heading, at 0.7 of the reach of the source [bound: time]
inline constexpr double kTurnM = 1.4;
// Logarithm of a likelihood ratio that one tree adds in the search at most [chosen]
inline constexpr double kMostScore = 1.7;
// Share of pairs whose sizes have no relation [chosen]
inline constexpr double kStrangeSizes = 0.25;
// Correlation of the ranks of one tree's heights, or diameters, in two maps [chosen]
inline constexpr double kSameSizeCorrelation = 0.6;
// The same of a diameter and a height [chosen]
inline constexpr double kOtherSizeCorrelation = 0.4;
// Share of the trees of a map that have a size, if sizes are to be used [chosen]
inline constexpr double kLeastSized = 0.7;
// m: neighbours within it are compared in size [chosen: some 30 trees]
inline constexpr double kRankRadiusM = 16.0;
// m: radius in which neighbours are counted to tell how dense the source is [chosen]
inline constexpr double kCrowdM = 8.0;
// Trees of the source per tree of the target, over one area, at most [tuned]
inline constexpr double kDominantDensity = 1.5;
// m: places of the search that are nearer to each other are one [chosen]
inline constexpr double kApartM = 3.0;
// Places of one heading that are kept [tuned]
inline constexpr std::size_t kOfHeading = 12;
// Places of all headings that are kept [tuned]
inline constexpr std::size_t kCandidates = 150;
// Steps of the first refinement [tuned]
inline constexpr int kFirstSteps = 6;
// Places that are refined to the end [tuned]
inline constexpr std::size_t kRefined = 50;
// Steps of that at most [chosen]
inline constexpr int kAllSteps = 40;
// Standard deviations beyond which trees are no partners [chosen]
inline constexpr double kReachSds = 3.0;
// Weight of pairs that a fit needs at least [bound: three parameters in the plane]
inline constexpr double kLeastWeight = 3.0;
// Share of the target's trees within the source's area that the source has, about [chosen]
inline constexpr double kSeenShare = 0.85;
// Distances of trees: the source counts as seen so far from a tree [tuned]
inline constexpr double kSeenReach = 1.3;
// Distances of trees: so far back from the edge of that [tuned]
inline constexpr double kSeenShrink = 0.9;
// Trees: the weight of the noise and the share that are expected, against those that fit [tuned]
inline constexpr double kPriorTrees = 15.0;
// m: least noise that is fitted [chosen]
inline constexpr double kLeastSdM = 0.15;
// m: most noise that is fitted [chosen]
inline constexpr double kMostSdM = 1.3;
// Least share of trees in common that is fitted [chosen]
inline constexpr double kLeastShare = 0.2;
// Most share of trees in common that is fitted [chosen]
inline constexpr double kMostShare = 0.95;
// m: a fit that moves less has ended [chosen]
inline constexpr double kStillM = 1e-4;
// m: fits that end nearer to each other are one place [chosen]
inline constexpr double kSamePlaceM = 2.0;
// Factor by which the part that is fitted grows from step to step [chosen]
inline constexpr double kGrowth = 1.5;
// m: pairs lie within it, or within the standard deviations below if that is more [chosen]
inline constexpr double kLeastPairM = 1.0;
// Standard deviations of the noise within which pairs lie [chosen]
inline constexpr double kPairSds = 2.5;
// Pairs with heights that give a shift in height at least [chosen]
inline constexpr std::size_t kLeastHeights = 3;
// Trees of each map at least [bound: fewer lie so by chance somewhere]
inline constexpr std::size_t kFewestTrees = 10;
// Trees with a partner at least for a place to be trusted [chosen]
inline constexpr double kLeastMatched = 8.0;
// m: radius of the area that is searched at most [bound: memory, time]
inline constexpr double kLargestRadiusM = 3000.0;
// m: a column of diameters with a greater median is in centimetres [bound: trees]
inline constexpr double kThickestM = 2.0;
// m: no map has a smaller median of diameters [bound: forests]
inline constexpr double kThinnestM = 0.01;
// Parts of the source that are tried [bound: time]
inline constexpr std::size_t kParts = 3;
// Cells along a side of a map of trees at most [bound: memory]
inline constexpr double kMostGridCells = 2000.0;
// Steps of the heading within which places of the search are one [chosen]
inline constexpr double kApartTurns = 2.5;
// Share of the reach of the source at which a step of the heading is kTurnM [bound: half of the
// area of a disc lies within]
inline constexpr double kTurnReach = 0.7;
// Distances of trees: cell of the area that the source counts as seen [chosen]
inline constexpr double kSeenCell = 0.3;
// m: such a cell at least [chosen]
inline constexpr double kLeastSeenCellM = 0.5;
// Factor of the noise when more of the source is laid on: a long map is bent [chosen]
inline constexpr double kGrownNoise = 1.3;
// m: that noise at least [chosen]
inline constexpr double kLeastGrownM = 0.5;
// Share of the matches that the part would lead to expect, below which growing ends [chosen]
inline constexpr double kGrownMatches = 0.6;
}  // namespace tree_match
namespace layer_frame {  // georeference/systems/layer_frame.cc
// m: nodes of the grid that points are interpolated in. The level plane leaves the ellipsoid by the
// square of the distance over twice the radius of the earth. In the middle of a cell that is 0.04
// mm [bound: geometry]
inline constexpr double kGridM = 32.0;
// cells from the origin: farther points go through PROJ one by one [bound: 32 bits]
inline constexpr double kMostCells = 1e6;
}  // namespace layer_frame

}  // namespace understory::georeference_constants
