#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

// The fitted and chosen numbers of `forest/stems` that are no settings, which stand in the
// Config structs. One namespace for each file that uses them. A comment gives the unit (none: a
// plain number), the meaning, and in brackets where the number comes from:
//   chosen   by judgement, fitted to nothing
//   bound    by physics, geometry, statistics, memory or time
//   tuned    on the recordings named; where none are, on simulated ones with seeds up to 19
//   probed   what a fifth less and a quarter more change, docs/method/constants.md. Where nothing
//            follows: two of 636 stems at most
// or real clouds and measurements by their page.
namespace understory::stem_constants {

namespace stem_detector {  // forest/stems/stem_detector.cc
// Share of a stem's directions that show a surface; stems' pieces were filled to 0.67 and more
// [tuned on simulated maps]
inline constexpr double kLeastFill = 0.65;
// Returns a slice: seen well enough for a cut-off piece to be none [tuned on simulated maps]
inline constexpr double kWellSeen = 50.0;
// degrees: steeper leans are rare, and a line through scattered points has them; they have to be
// better supported [tuned on simulated maps]
inline constexpr double kSteepLeanDeg = 8.0;
// Sum of the ratios of points inside and outside of the surface, of a steep stem at most [tuned
// on simulated maps]
inline constexpr double kSteepClutter = 0.25;
// The same of a stem of two rings ... [tuned on simulated maps]
inline constexpr double kClutterOfTwo = 0.34;
// ... and what each further ring adds: in a thicket it takes many slices that agree [tuned on
// simulated maps]
inline constexpr double kClutterPerRing = 0.085;
// The same at most [tuned on simulated maps]
inline constexpr double kMostClutter = 0.65;
// m: scatter from which few rings have to be clean [tuned on simulated maps]
inline constexpr double kNoisyScatter = 0.029;
// rings that are few then [tuned on simulated maps]
inline constexpr double kFewRings = 6.0;
// Sum of the ratios at most then [tuned on simulated maps]
inline constexpr double kNoisyClutter = 0.4;
// m: radius of a slim column that may stand alone [tuned on simulated maps]
inline constexpr double kSlimRadius = 0.1;
// Ratio of points outside of it at most [tuned on simulated maps]
inline constexpr double kAloneOutside = 0.12;
// degrees that it leans at most [tuned on simulated maps]
inline constexpr double kAloneLeanDeg = 10.0;
// m that it extends at least [tuned on simulated maps]
inline constexpr double kAloneExtent = 1.5;
// Share of its slices that show it [tuned on simulated maps]
inline constexpr double kAloneSlices = 0.85;
// degrees of its circle that are seen evenly [tuned on simulated maps]
inline constexpr double kAloneArcDeg = 90.0;
// Sum of the ratios of a column that stands clear [tuned on `random` 13, docs/method/forest.md]
inline constexpr double kClearClutter = 0.15;
// m over breast height: its foot may be hidden so far up [tuned on `random` 13]
inline constexpr double kClearBeginsAbove = 1.3;
// m that it extends at least [tuned on `random` 13]
inline constexpr double kClearExtent = 1.0;
// degrees of its circle that are seen evenly [tuned on `random` 13]
inline constexpr double kClearArcDeg = 60.0;
// Share of its directions that show a surface [tuned on `random` 13: a noisy stem from afar has
// 0.52 and more, what shows another side in each slice less than that]
inline constexpr double kClearFill = 0.5;
// Radii: error of its radius at most [chosen: the deviation of its diameter is told]
inline constexpr double kClearSd = 0.5;
// Spreads of the refined fit that are its error [chosen]
inline constexpr double kClearSpreads = 1.4;
// Radii: its scatter at most [chosen]
inline constexpr double kClearScatterShare = 0.25;
// Share of the slices between its ends that show a stem [tuned on simulated maps]
inline constexpr double kLeastSliceShare = 0.6;
// m that a stem extends at least [tuned on simulated maps]
inline constexpr double kLeastExtent = 0.7;
// m over breast height: what begins higher is a branch or a crown [tuned on simulated maps]
inline constexpr double kBeginsAbove = 0.3;
// Share of the seen arc that has to be seen evenly [tuned on simulated maps]
inline constexpr double kEvenArcShare = 0.35;
// m: error of a diameter at most ... [tuned on simulated maps]
inline constexpr double kDbhSd = 0.01;
// ... and of the diameter, added [tuned on simulated maps]
inline constexpr double kDbhSdShare = 0.08;
// Sum of the ratios of what only thick slices show, where points are many [tuned on simulated
// maps]
inline constexpr double kThickOnlyClutter = 0.25;
// m: scatter of it [tuned on simulated maps]
inline constexpr double kThickOnlyScatter = 0.025;
// Ratio of points inside a stem at most [tuned on simulated maps]
inline constexpr double kMostInside = 0.35;
// Sum of the ratios of a stem that shows in few slices [tuned on simulated maps]
inline constexpr double kFewSlicesClutter = 0.25;
// radii: error of its radius at most [tuned on simulated maps]
inline constexpr double kFewSlicesSd = 0.35;
// Slices that a thick one of the second search holds [probed]
inline constexpr double kThickSlices = 3.0;
// Thick slices that show a stem at least [probed]
inline constexpr int kLeastThickSlices = 2;
// m: radius of what shows in no more thick slices than these, at most. Two whorls of branches make
// such circles [tuned on `treels/pine_plot` laid otherwise: whorls have 18 to 22 cm]
inline constexpr double kMostOfFewThickSlices = 0.15;
// m that the slices of a search for hidden stems lie higher [chosen: feet that are hidden to 3 m,
// to 4 m]
inline constexpr std::array<double, 2> kHiddenRises = {1.0, 2.0};
// m above the ground, with the rise: heights of these searches, from ... [tuned on `random` 3, 13,
// 14]
inline constexpr double kHiddenLowest = 1.25;
// ... to [tuned likewise]
inline constexpr double kHiddenHighest = 3.25;
// m of heights below such a search in which a shadow has to show [chosen]
inline constexpr double kShadowHeight = 1.0;
// m/m: how far the taper of stems differs from the usual one, below what was seen [chosen:
// stem_fit::kTaperSd]
inline constexpr double kTaperSdBelow = 0.006;
// m: distance of connected points in a thin slice [probed]
inline constexpr double kThinReach = 0.08;
// m: the same in a thick slice [probed]
inline constexpr double kThickReach = 0.12;
// m: half of the width of a circle's band in a thin slice [probed]
inline constexpr double kThinBand = 0.02;
// m: the same in a thick slice [probed]
inline constexpr double kThickBand = 0.025;
// Of the least diameter: radius of a circle at least, as the edge of a stem is blurred [probed]
inline constexpr double kLeastRadiusShare = 0.4;
// Radii: scatter of a column that stands alone at most ... [probed]
inline constexpr double kAloneScatterShare = 0.4;
// ... and m, added [probed]
inline constexpr double kAloneScatter = 0.006;
// Share of the least arc that has to be seen evenly [probed]
inline constexpr double kEvenArcOfLeast = 0.8;
// Points a slice: more are many [probed]
inline constexpr int kDensePointsPerSlice = 12;
// m: scatter of a stem at most, or ... [probed]
inline constexpr double kMostScatter = 0.012;
// ... radii, whichever is more ... [probed]
inline constexpr double kMostScatterShare = 0.2;
// ... and m, added to either [probed: x 0.8 no figure; x 1.25 no byte]
inline constexpr double kScatterSlack = 0.008;
// Share of all slices that show a stem without a doubt [probed: x 0.8 +2 stems, +1 false; x 1.25 -2
// stems]
inline constexpr double kShownByMost = 0.8;
// Share of all slices below which a piece that was seen well is cut off [probed: no byte]
inline constexpr double kShownByFew = 0.4;
// Stems whose centres are nearer than this share of both radii are one [probed: x 0.8 no byte; x
// 1.25 -1 false]
inline constexpr double kSameOfBoth = 0.85;
// So are stems whose centres are nearer than the larger radius and this share of the smaller one
// [probed: no byte]
inline constexpr double kSameOfSmaller = 0.3;
// m: diameter of a thin stem within foliage at most: a thicker one shows its surface [chosen]
inline constexpr double kFoliageDbh = 0.1;
// m around the radius in which points of a leaning stem are looked for [bound: 25 degrees of lean
// over 2.2 m are 1.03 m]
inline constexpr double kLeanReach = 1.2;
// m beyond the radius whose points belong to a stem [probed: x 0.8 no byte; x 1.25 no figure]
inline constexpr double kExplainedMargin = 0.06;
// m beyond the radius of a start in which its points are looked for [bound: kFitReach and what a
// lean adds]
inline constexpr double kStartReach = 0.4;
// m beyond the radius whose points enter the fit [probed: no figure]
inline constexpr double kFitReach = 0.35;
// m beyond a tile in which stems are looked for: they compete with those of the tile [chosen: two
// of the largest stems and more]
inline constexpr double kFitsBeyond = 3.0;
// m beyond a tile in which circles are looked for: a leaning stem's lie so far apart [chosen]
inline constexpr double kRingsBeyond = 6.0;
}  // namespace stem_detector

namespace shadowed_points {  // forest/slice/shadowed_points.cc
// m: edge of the squares that points are counted in [chosen]
inline constexpr double kSquare = 0.5;
// Points below over those that are searched, over a shadow at most [tuned on `random` 3, 13, 14]
inline constexpr double kBelowShare = 0.1;
}  // namespace shadowed_points

namespace not_a_tree {  // forest/stems/not_a_tree.cc
// m above the ground: posts and people end below [bound: people]
inline constexpr double kLowEnd = 2.3;
// m above the end of a stem that are left out: the end is blurred [chosen]
inline constexpr double kAboveEnd = 0.15;
// m of a stem, and of the heights above it, that there have to be [chosen]
inline constexpr double kLeastSpan = 0.5;
// m from the surface: points that are on it [chosen]
inline constexpr double kOnSurface = 0.03;
// m beyond the surface: points above the end that may be the tree's own, by its branches or by an
// error of the lean [tuned on random seeds]
inline constexpr double kNearAxis = 0.3;
// m beyond the surface: from here on points are around it [chosen]
inline constexpr double kNotNear = 0.4;
// m from the axis: points around it at most [chosen]
inline constexpr double kAroundReach = 3.0;
// thinned points around it that show that the heights above were in view [tuned on random seeds]
inline constexpr int kAroundPoints = 40;
// thinned points that a stem would have above its end: with fewer expected nothing is said
// [bound: by chance none of 20 is there once in 500 million times]
inline constexpr double kLeastExpected = 20.0;
// Of the points that a stem would have above its end: with more it goes on [tuned on random seeds]
inline constexpr double kAboveShare = 0.005;
// m beyond the surface: points above the end of a stem that are its own, if it goes on [chosen]
inline constexpr double kGoesOn = 0.05;
// Of the points on the last half metre of a stem: so many more beside it above the end hide no stem
// [chosen: to hide it takes about as many]
inline constexpr double kMoreBeside = 0.25;
// m from the axis: points behind a stem that ends suddenly, at most [tuned on `random` 1, 8, 13,
// 16]
inline constexpr double kBehindReach = 6.0;
// Length of the mean direction of the sides that were seen: less, and they lie all around [chosen:
// 0.64 is half of a circumference]
inline constexpr double kOneSided = 0.3;
// Cosine of the angle to the line of sight within which a place is behind a stem [chosen: 30
// degrees]
inline constexpr double kBehindCosine = 0.866;
// m beyond the surface of a stem from which on a plane is looked for beside it [chosen]
inline constexpr double kBesideFrom = 0.05;
// m of such a plane [chosen]
inline constexpr double kBesideLength = 0.5;
// m: half of its thickness [chosen]
inline constexpr double kSlabHalf = 0.03;
// m from its middle: points that are beside it [chosen]
inline constexpr double kSlabFar = 0.15;
// Pieces of it along [chosen]
inline constexpr std::size_t kColumns = 5;
// The same upwards [chosen]
inline constexpr std::size_t kRows = 8;
// Share of the pieces that hold points, of a wall at least [tuned on random seeds]
inline constexpr double kCovered = 0.7;
// thinned points of a wall at one side of a stem at least [chosen]
inline constexpr int kWallPoints = 60;
// m of height in which a wall has to show [chosen]
inline constexpr double kWallHeight = 1.0;
// Points a thickness beside a wall over those on it, at most [tuned on random seeds]
inline constexpr double kBesideShare = 0.15;
// Directions of planes that are tried [bound: time]
inline constexpr int kTurns = 36;
// m by which a leaning stem's points lie farther from its place at breast height [chosen]
inline constexpr double kLeanReach = 0.3;
}  // namespace not_a_tree

namespace ring_linker {  // forest/search/ring_linker.cc
// m: edge of the cells in which rings of other slices are looked for [chosen]
inline constexpr double kRingCell = 1.0;
// m by which the radii of two rings of one stem differ at most ... [probed: no figure]
inline constexpr double kSameRadius = 0.03;
// ... and of the larger radius, added [probed: no figure]
inline constexpr double kSameRadiusShare = 0.3;
// m to the side of a ring where the next one of a vertical stem may lie [probed: x 0.8 no figure; x
// 1.25 no byte]
inline constexpr double kBesideReach = 0.05;
// m that a ring may lie off the line at most ... [probed: x 0.8 +1 false; x 1.25 +1 stem]
inline constexpr double kOffLine = 0.04;
// ... and radii, added [probed: x 0.8 +1 false; x 1.25 no figure]
inline constexpr double kOffLineShare = 0.2;
}  // namespace ring_linker

namespace surface_band {  // forest/stems/surface_band.h
// Scatters: points so near to the surface are on it [probed: x 0.8 -1 false; x 1.25 +1 stem, -1
// false]
inline constexpr double kBandScatters = 2.5;
// m: the same at least [probed: x 0.8 no byte; x 1.25 no figure]
inline constexpr double kLeastBand = 0.015;
// Bands under the surface from which on a point is inside ... [probed: no byte]
inline constexpr double kInsideBands = 2.0;
// ... or radii under it, whichever is more [probed: no byte]
inline constexpr double kInsideShare = 0.3;
}  // namespace surface_band

namespace stem_fit {  // forest/stems/stem_fit.cc
// m/m: radius lost per metre of height in a stem's lower part [chosen]
inline constexpr double kUsualTaper = -0.008;
// m/m: how far stems differ from it [chosen]
inline constexpr double kTaperSd = 0.006;
// m/m: how far the slope may leave that of the rings [chosen]
inline constexpr double kSlopeSd = 0.05;
// m: scatter of points about a stem, at least [bound: noise of lidars]
inline constexpr double kLeastScatter = 0.004;
// m: scatter of points about a stem, at most [chosen]
inline constexpr double kMostScatter = 0.03;
// 1/m: what the error of a radius grows by with its own square [tuned on handheld seeds 1 and 2,
// harvester seed 1, true poses: 95 % within two standard deviations]
inline constexpr double kSquare = 1400.0;
// Times the fit's own error: returns are not independent [tuned like kSquare]
inline constexpr double kLinear = 1.5;
// m of the radius: keyframes do not quite lie on each other, stems are not round [tuned like
// kSquare]
inline constexpr double kMapError = 0.002;
// points that a fit takes [bound: time]
inline constexpr std::size_t kEnoughPoints = 400;
// Scatters beyond which a point has no weight (Tukey) [probed: x 0.8 no figure; x 1.25 +1 stem]
inline constexpr double kReachScatters = 4.0;
// m from the surface of the start: points that a fit takes [probed: x 0.8 thin +0.4 mm; x 1.25 thin
// +0.6 mm]
inline constexpr double kSampleReach = 0.15;
// m: radius of a thin start at least [probed: x 0.8 no byte; x 1.25 no figure]
inline constexpr double kThinRadius = 0.02;
// Spreads of the points in the plane that make its radius [probed: x 0.8 +1 false; x 1.25 no
// figure]
inline constexpr double kThinSpreads = 0.7;
// m: scatter that a fit begins with at least [probed: no figure]
inline constexpr double kFirstScatter = 0.015;
// m from the surface: points that tell the scatter [probed: x 0.8 no figure; x 1.25 +1 stem]
inline constexpr double kScatterReach = 0.05;
// Steps of a fit at most [bound: convergence]
inline constexpr int kMostSteps = 12;
// m: a fit that steps farther has failed [probed: no byte]
inline constexpr double kLongestStep = 0.3;
// Of the least diameter: a fit with a smaller radius has failed [probed: no byte]
inline constexpr double kLeastRadiusShare = 0.3;
// Steps before the scatter is taken from the points [probed: no figure]
inline constexpr int kFixedScatterSteps = 3;
// m: a fit whose step is shorter has ended [probed: no figure]
inline constexpr double kSettled = 2e-4;
// Radii: with more scatter a thin stem is tried as well [probed: no figure]
inline constexpr double kThinTryScatter = 0.12;
// Share of the directions that show a surface: with less a thin stem is tried [probed: no byte]
inline constexpr double kThinTryFill = 0.7;
// Share of the arc that is seen evenly: with less a thin stem is tried [probed: no byte]
inline constexpr double kThinTryArc = 0.5;
// Share of points off the surface that a thin stem may have more [probed: no figure]
inline constexpr double kThinStrays = 0.05;
// m outside of the surface: points that a thin stem within foliage is fitted to [chosen]
inline constexpr double kFoliageReach = 0.06;
// Share of these that may be of the foliage, at most [chosen]
inline constexpr double kFoliageStrays = 0.9;
// m: a thinner stem within foliage counts as this thin [bound: noise of lidars]
inline constexpr double kFoliageLeastRadius = 0.01;
// Of these the fit takes so many at most: few of them are of the stem [bound: time]
inline constexpr int kFoliagePoints = 1000;
// Steps of 10 degrees that hold points on a stem seen all round ... [chosen]
inline constexpr double kOvalBins = 30.0;
// ... degrees over which these points would spread if they lay evenly ... [tuned on random 8]
inline constexpr double kOvalEvenDeg = 220.0;
// ... and their scatter as a share of the radius at most [tuned on random 8]
inline constexpr double kOvalScatter = 0.2;
}  // namespace stem_fit

namespace noisy_cylinder {  // forest/stems/noisy_cylinder.cc
// m: scatter of ranges at least [bound: noise of lidars]
inline constexpr double kLeastScatter = 0.004;
// Directions from which a stem may have been seen [chosen]
inline constexpr int kViews = 24;
// Share of a direction that gave nothing: keeps logarithms finite [bound: rounding]
inline constexpr double kLeastView = 1e-4;
// m: scatter that a fit begins with at least [probed: no figure]
inline constexpr double kFirstScatterLeast = 0.01;
// m: the same at most [probed: x 0.8 no figure; x 1.25 no byte]
inline constexpr double kFirstScatterMost = 0.03;
// Points of a fit at least [bound: six parameters]
inline constexpr std::size_t kFewestPoints = 8;
// m: a fit whose step is shorter has ended [probed: x 0.8 no figure; x 1.25 thin -0.4 mm]
inline constexpr double kSettled = 4e-5;
// Times that an extrapolation goes beyond a step at most [probed: x 0.8 no figure; x 1.25 thin +0.3
// mm, sd +1 %]
inline constexpr double kMostStretch = 6.0;
// Scatters between places on the circumference: the scatter blurs the gaps [probed: no figure]
inline constexpr double kBinScatters = 0.8;
// The same where noise lies along the beams [bound: a sum of Gaussians so far apart is even to
// 1e-5]
inline constexpr double kNoisyBinScatters = 1.3;
// Share by which the variance of the scatter is smaller along the beams, where these have noise
// [fitted: maps by one ray a beam, to 15 m]
inline constexpr double kLessAlong = 0.4;
// Of the variance of the noise, the share that is beside the scatter at least [bound: division]
inline constexpr double kLeastShareAlong = 0.1;
// m: noise along the beams that a fit finds, at least [bound: rounding]
inline constexpr double kLeastRangeNoise = 0.001;
// m: the same at most [bound: scanners]
inline constexpr double kMostRangeNoise = 0.1;
// Places on the circumference at least [probed: no figure]
inline constexpr double kFewestBins = 24.0;
// Places on the circumference at most [bound: time]
inline constexpr double kMostBins = 160.0;
// Standard deviations of the angle from which a point may have come [bound: the rest is below 0.1
// %]
inline constexpr double kBlurReach = 3.5;
// Share of the points that must lie on the surface [probed: no byte]
inline constexpr double kLeastWeight = 0.2;
// m: a fit with a smaller radius has failed [probed: no byte]
inline constexpr double kLeastRadius = 0.008;
// m: a fit that goes farther from its start has failed [probed: no byte]
inline constexpr double kFarthest = 0.5;
// Share of points off the surface that a fit begins with [probed: x 0.8 no figure; x 1.25 RMSE -0.6
// mm]
inline constexpr double kFirstStrays = 0.05;
// The same at least [probed: no figure]
inline constexpr double kLeastStrays = 0.005;
// Rounds in which the seen directions are found [bound: convergence]
inline constexpr int kViewRounds = 4;
}  // namespace noisy_cylinder

namespace standing_direction {  // forest/stems/standing_direction.cc
// m: one point each, or what is near would count most [chosen]
inline constexpr double kVoxel = 0.2;
// m: edge of the cells whose lowest point is the ground [chosen]
inline constexpr double kGroundCell = 2.0;
// m: points above that are looked at [chosen]
inline constexpr double kAboveGround = 1.5;
// Voxels that are looked at [bound: time]
inline constexpr std::size_t kMostVoxels = 60'000;
// Voxels at least, or nothing is told [chosen]
inline constexpr std::size_t kLeastVoxels = 2'000;
// degrees from z: directions farther away are not tried [chosen]
inline constexpr double kFarthestDeg = 72.0;
// degrees from z: nearer directions count as z [chosen]
inline constexpr double kNearZDeg = 6.0;
// m: edge of a column in the first search [chosen]
inline constexpr double kCoarseCell = 1.0;
// degrees between the directions of the first search [chosen]
inline constexpr double kCoarseDeg = 6.0;
// m: edge of a column in the last search [chosen]
inline constexpr double kCell = 0.5;
// Directions of the first search that are looked at closely [chosen]
inline constexpr std::size_t kFinalists = 4;
// Columns to those that are compared with [chosen]
inline constexpr int kApart = 3;
// Columns at most [bound: memory]
inline constexpr double kMostCells = 4e6;
}  // namespace standing_direction

namespace circle_search {  // forest/search/circle_search.cc
// Pairs of points that are tried with a drawn one [bound: time]
inline constexpr int kTriesPerDraw = 9;
// m: edge of the cells that count points on a circle [bound: time]
inline constexpr float kFineCell = 0.08F;
// m: edge of the cells that points are drawn from [bound: time]
inline constexpr float kCoarseCell = 0.3F;
// Cells of a row between which points are moved up where others are taken away [bound: time]
inline constexpr int kStretch = 64;
// m: around a sampled circle that points are gathered to fit it to, at first [bound: time]
inline constexpr double kRefineMargin = 0.1;
// Points of a group that are sorted anew when the lowest of them goes, at most [bound: time]
inline constexpr std::size_t kMostSortedAnew = 500'000;
// Share of the seen arc that has to be seen evenly [probed: x 0.8 no byte; x 1.25 no figure]
inline constexpr double kEvenArcShare = 0.3;
// Bands: scatter of a circle at most, or ... [probed: x 0.8 +1 stem, -1 false, thin +0.9 mm; x 1.25
// RMSE -0.6 mm, sd +1 %]
inline constexpr double kMostScatterBands = 0.6;
// ... radii, whichever is more [probed: no figure]
inline constexpr double kMostScatterShare = 0.12;
// m: distances of the three points that a circle is drawn through, in turn [probed: x 0.8 no
// figure; x 1.25 -1 false]
inline constexpr std::array<float, 4> kScales = {0.08F, 0.2F, 0.45F, 0.9F};
// Draws of a group at least [bound: time]
inline constexpr std::size_t kFewestDraws = 24;
// Points of a group for each further draw [bound: time]
inline constexpr std::size_t kPointsPerDraw = 8;
// Draws of a group at most [bound: time]
inline constexpr std::size_t kMostDraws = 150;
// m: a circle counts by the power 0.7 of its radius and this [probed: x 0.8 no figure; x 1.25 +1
// stem, sd +1 %]
inline constexpr double kLengthOffset = 0.15;
// Points on a circle that one inside it outweighs [probed: no byte]
inline constexpr double kInsideWeight = 1.5;
}  // namespace circle_search

namespace point_groups {  // forest/search/point_groups.cc
// m: edge of the windows that large groups are cut by. The origin of a search is a multiple of it
// [bound: time]
inline constexpr double kWindow = 8.0;
// m: a group that is longer is cut [chosen: longer than a large tree's points at breast height]
inline constexpr double kLongest = 4.0;
// m: two cells of the coarsest grouping [bound: cells that touch]
inline constexpr double kCellSlack = 0.5;
}  // namespace point_groups

}  // namespace understory::stem_constants
