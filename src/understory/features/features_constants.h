#pragma once

#include <cstddef>
#include <cstdint>
#include <numbers>

// The fitted and chosen numbers of the layer `features` that are no settings, which stand in the
// Config structs. One namespace for each file that uses them. A comment gives the unit (none: a
// plain number), the meaning, and in brackets where the number comes from:
//   chosen   by judgement, fitted to nothing
//   bound    by physics, geometry, statistics, memory or time
//   tuned    on the recordings named; where none are, on simulated ones with seeds up to 19
//   probed   what a fifth less and a quarter more change, docs/method/constants.md
// or real clouds and measurements by their page.
// The weights of the score of stems stand in stem_score.cc: benchmarks/stem_score.py fits them and
// writes them there.
namespace understory::features_constants {

namespace ground_guess {  // features/ground_guess.cc
// m: edge of a cell that keeps its lowest return [chosen]
inline constexpr double kCell = 1.5;
// m: edge of a patch that shares one plane [chosen]
inline constexpr double kPatch = 3.0;
// cells to each side of a patch's middle that its plane is fitted to [chosen]
inline constexpr int kReach = 4;
// m/m: slopes of the ground that are expected, one standard deviation [chosen]
inline constexpr double kSlopeSd = 0.15;
// m: scatter of lowest returns about a plane [chosen]
inline constexpr double kRelief = 0.08;
// m: error of a height where the ground shows all around. Feet are 10 to 13 cm off where the fit
// leaves 5 cm open [tuned on lieksa1 to lieksa3, seed 5]
inline constexpr double kLeastSd = 0.1;
// m: what a fit leaves open where feet are off by kLeastSd [tuned on lieksa1 to lieksa3, seed 5]
inline constexpr double kFitSd = 0.05;
// m/m: from there on feet are off six times as much more, as lowest returns that are no ground
// lift the plane [tuned on lieksa1 to lieksa3, seed 5]
inline constexpr double kGrowth = 6.0;
// m: error of a height where the ground hides [chosen]
inline constexpr double kMostSd = 1.0;
// m/m: scatter of lowest returns about a plane, growing with the distance [probed: x 0.8 APE +0.9
// mm, -3 trees, +1 false, RMSE -0.9 mm; x 1.25 APE -1 mm, RMSE +0.2 mm]
inline constexpr double kReliefGrowth = 0.05;
}  // namespace ground_guess

namespace ring_view {  // features/ring_view.cc
// m: width of a section at most [bound: stems of forests in use]
inline constexpr double kWidest = 1.0;
// m: what lies no farther behind a section is part of the same thicket [chosen]
inline constexpr double kRoughDepth = 0.5;
// m: returns that near to a place are at it [chosen]
inline constexpr double kDepthMargin = 0.3;
// steps of a ring: so far apart, a return is missing between two [chosen]
inline constexpr float kGap = 1.6F;
// steps of a ring: one lost return does not cut a run [chosen]
inline constexpr float kBridged = 2.6F;
// Steps of azimuth, and bends, that tell what is usual at least [probed: no byte]
inline constexpr std::size_t kFewestSteps = 16;
// Quantile of the steps that is a step without a lost return [probed: no byte]
inline constexpr double kUsualQuantile = 0.2;
// Times that: longer steps have lost a return [probed: no byte]
inline constexpr double kMostSteps = 1.5;
// Steps that three returns in a row span at most [probed: x 0.8 -1 and +1 trees; x 1.25 RMSE -0.3
// mm]
inline constexpr double kBendSteps = 2.5;
// m: larger bends are edges [probed: x 0.8 -1 tree, +1 false; x 1.25 RMSE -0.3 mm]
inline constexpr double kMostBend = 0.2;
// Median of the absolute value over the standard deviation [bound: normal distribution]
inline constexpr double kNormalMedian = 0.67;
// m: noise of a range at least [bound: lidars]
inline constexpr double kLeastRangeSd = 0.005;
// m: noise of a range at most [bound: lidars]
inline constexpr double kMostRangeSd = 0.03;
// m of range between two returns of one stem at most [probed: x 0.8 +2 trees, +1 false; x 1.25 no
// figure]
inline constexpr float kMostLink = 0.25F;
// Standard deviations of a range between them at most, and ... [probed: x 0.8 APE -0.6 mm, -1 and
// +1 trees; x 1.25 RMSE -0.4 mm]
inline constexpr float kLinkSds = 4.0F;
// ... roots of m of their spacing, as a round surface falls off [probed: x 0.8 APE -0.7 mm, -1
// tree; x 1.25 RMSE -0.4 mm]
inline constexpr float kLinkDepth = 0.4F;
}  // namespace ring_view

namespace scan_rings {  // features/scan_rings.cc
// Points of a ring by which its spread is told [chosen]
inline constexpr double kFewestPoints = 50.0;
// rad: standard deviation of the elevations of a level ring. Vertical offsets of beams give 0.01 at
// a metre, a line of a Mid-360 0.3 [chosen]
inline constexpr double kMostSdRad = 0.08;
}  // namespace scan_rings

namespace stem_chain {  // features/stem_chain.cc
// Squared Mahalanobis distance in the plane within which a section is on a line; chi squared of 2
// degrees, 99.8 % [bound: statistics]
inline constexpr double kGate = 12.0;
// m along a stem without a section [chosen]
inline constexpr double kLongestGap = 3.0;
// Radii by which the mean of a round surface seen from one side lies before the axis [bound:
// geometry, P1 F11]
inline constexpr double kMeanDepth = std::numbers::pi / 4.0;
// m/m: radius lost per metre of height. Seen from one side the surface leans back by pi/4 of
// that, 0.22 degrees [chosen: stems lose 1 cm of diameter a metre]
inline constexpr double kUsualTaper = -0.005;
// m: error of the worst section's centre [chosen]
inline constexpr double kWorstSection = 0.06;
// m^2: variance of a centre along the sight at least [probed: no figure]
inline constexpr double kLeastAlongVariance = 1e-5;
// Radii: spread of the depth of a round surface seen from one side [bound: geometry]
inline constexpr double kDepthSpread = 0.22;
// m^2: variance of a centre across the sight, added [probed: x 0.8 APE -0.5 mm; x 1.25 no figure]
inline constexpr double kLeastAcrossVariance = 1e-4;
// Median widths beyond which something else has widened a section, and ... [probed: x 0.8 RMSE -0.2
// mm; x 1.25 RMSE +2.0 mm]
inline constexpr double kWidened = 1.6;
// ... m, added [probed: no figure]
inline constexpr double kWidenedBy = 0.02;
// m: error of a radius that a stem shows by itself, added [probed: no figure]
inline constexpr double kRadiusSd = 0.004;
// Rounds in which the weights of sections are found [bound: convergence]
inline constexpr int kFitRounds = 4;
// Squared Mahalanobis distance that counts for the misfit at most [probed: x 0.8 +1 tree, +1 false,
// RMSE -0.2 mm; x 1.25 -1 tree, RMSE -0.2 mm]
inline constexpr double kMostSquare = 25.0;
}  // namespace stem_chain

namespace stem_segments {  // features/stem_segments.cc
// rad: lean of stems against up, one standard deviation [chosen]
inline constexpr double kLeanSd = 0.05;
// Usual radii: diameters are told where returns are nearer to each other. Where fewer than three
// fall on a stem its edges are lost more often than not, and it looks thin [chosen, on simulated
// frames]
inline constexpr double kFineSpacing = 0.7;
// m: above this error a diameter says more about the spacing of the beams than about the stem
// [chosen]
inline constexpr double kDiameterKnown = 0.025;
// rad: levels differ enough to look again [chosen]
inline constexpr double kUpMatters = 0.03;
// m above the ground: lowest point of a stem where the ground is unknown [chosen]
inline constexpr double kUsualStart = 0.3;
// m: error of a radius that counts for the usual one at most [probed: x 0.8 -1 tree, RMSE +1.6 and
// -0.3 mm; x 1.25 RMSE -0.6 mm]
inline constexpr double kSureRadius = 0.02;
// Median differences that make the spread of radii [bound: normal distribution, 1.48]
inline constexpr double kSpreadMedians = 1.5;
// m: spread of radii at least [probed: x 0.8 no byte; x 1.25 no figure]
inline constexpr double kLeastSpread = 0.015;
// m: spread of radii at most [probed: no byte]
inline constexpr double kMostSpread = 0.1;
// (m/m)^2: variance of a lean that counts for the usual one at most [probed: no figure]
inline constexpr double kSureLean = 4e-4;
// Median of a chi squared of 2 degrees over 2 [bound: statistics]
inline constexpr double kChiMedian = 0.69;
// m/m: usual lean at least [probed: no byte]
inline constexpr double kLeastLean = 0.015;
// m above the foot from which on sections tell the diameter [probed: x 0.8 RMSE -0.2 mm; x 1.25
// RMSE +0.5 mm]
inline constexpr double kBreastFrom = 0.5;
// m above the foot up to which they do [probed: x 0.8 RMSE +1.5 and -0.6 mm; x 1.25 RMSE +1.0 mm]
inline constexpr double kBreastTo = 2.3;
// m beyond the larger radius: segments that are nearer stand at one place [probed: no figure]
inline constexpr double kOnePlace = 0.15;
// Of the least score: chains with less are dropped before what is usual is known [probed: x 0.8 no
// figure; x 1.25 RMSE -0.3 mm]
inline constexpr double kWorthFitting = 0.05;
// Of the least score: chains with less are dropped before the ground is looked for [probed: no
// byte]
inline constexpr double kWorthGround = 0.3;
// Score from which on a stem tells where up is [probed: x 0.8 no figure; x 1.25 APE -3 mm, -11
// trees, RMSE -1.3 mm]
inline constexpr double kSure = 0.8;
}  // namespace stem_segments

namespace lidar_stems {  // features/lidar_stems.cc
// m between two stems that two lidars see: nearer ones are one tree [chosen: a thick stem's radius]
inline constexpr double kSameStem = 0.3;
}  // namespace lidar_stems

namespace stem_score {  // features/stem_score.cc: scales of the traits; their weights stand there
// m^2, sections of a level: others whose surface lies within 0.6 m crowd a section [chosen]
inline constexpr double kCrowdM2 = 0.36;
// Sections to either side that are looked at [chosen]
inline constexpr int kCrowdSections = 6;
// Lean that counts as one (m/m) [chosen: most stems lean less]
inline constexpr double kLean = 0.06;
// Traits in standard deviations, or in leans, count no farther [chosen]
inline constexpr double kMostSds = 4.0;
// m that are added to the extent of a chain before its logarithm [chosen: 0 has a value then]
inline constexpr double kExtentM = 0.1;
// m that are added to its lowest height above the ground [chosen: likewise]
inline constexpr double kLowestM = 0.3;
// m that are added to the error of a width [chosen: likewise]
inline constexpr double kWidthM = 0.05;
// The same, usual diameters: to the spacing of returns [chosen]
inline constexpr double kSpacing = 0.02;
}  // namespace stem_score

namespace tree_tops {  // features/tree_tops.cc
// Standard deviations to which a smoothed canopy takes neighbours [bound: 99 % of the weight]
inline constexpr double kSmoothedSds = 2.5;
}  // namespace tree_tops

}  // namespace understory::features_constants
