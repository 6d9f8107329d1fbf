#pragma once

#include <cstddef>
#include <cstdint>
#include <numbers>

// The fitted and chosen numbers of the layer `graph` that are no settings, which stand in the
// Config structs. One namespace for each file that uses them. A comment gives the unit (none: a
// plain number), the meaning, and in brackets where the number comes from:
//   chosen   by judgement, fitted to nothing
//   bound    by physics, geometry, statistics, memory or time
//   tuned    on the recordings named; where none are, on simulated ones with seeds up to 19
//   probed   what a fifth less and a quarter more change, docs/method/constants.md
//   not recorded   in use for long, and nothing tells why it is this number
// or real clouds and measurements by their page.
namespace understory::graph_constants {

// rad a degree [mathematics]
inline constexpr double kRadPerDegree = std::numbers::pi / 180.0;

namespace pose_graph {  // graph/pose_graph.cc
// Loops up to which graduated non-convexity is run in full at each handover [bound: time, half a
// second of one processor]
inline constexpr std::size_t kFewLoops = 200;
// Solutions at most until used loops and their residuals agree [chosen]
inline constexpr int kTurnsToAgree = 4;
// Loops that may change sides at one of these; more are no small change of the graph [chosen]
inline constexpr std::size_t kMostChanges = 20;
}  // namespace pose_graph

namespace gnss_fusion {  // graph/gnss_fusion.cc
// Keyframes that the expected error of a path is a mean of [bound: time]
inline constexpr std::size_t kKeyframesOfExpectedError = 50;
}  // namespace gnss_fusion

namespace structure {  // graph/self_correction/structure.cc
// m: edge of the columns in which the ground is looked for [chosen]
inline constexpr double kColumn = 2.0;
}  // namespace structure

namespace gaussian_correction {  // graph/self_correction/gaussian_correction.cc
// Loops that the regression is told; its time is cubic in them [bound: time]
inline constexpr std::size_t kMostLoops = 200;
}  // namespace gaussian_correction

namespace stem_sights {  // graph/self_correction/stem_sights.cc
// Share of all sights that a range or an angle holds [chosen]
inline constexpr double kShare = 0.9;
}  // namespace stem_sights

namespace path_process {  // graph/self_correction/path_process.cc
// Observations that length and scale are found from; the time is cubic in them [bound: time]
inline constexpr std::size_t kEnough = 60;
// views: lengths of the correlation that are tried [bound: time]
inline constexpr double kLengths[] = {0.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0};
// Half powers of two that are tried as the scale of the odometry at least [bound: time]
inline constexpr int kLeastHalfPowers = -8;
// The same at most [bound: time]
inline constexpr int kMostHalfPowers = 12;
}  // namespace path_process

namespace stem_correction {  // graph/self_correction/stem_correction.cc
// rad by which up may turn from one view to the next, one standard deviation [chosen]
inline constexpr double kStepTilt = 0.2 * kRadPerDegree;
// rad by which a stand leans as a whole, one standard deviation [chosen]
inline constexpr double kStandLeans = 0.3 * kRadPerDegree;
// m of way to each side whose views see the same trees [chosen]
inline constexpr double kSameTrees = 10.0;
// rad: tilt of a step with little overlap, one standard deviation [probed: no figure]
inline constexpr double kWeakTilt = 0.5 * kRadPerDegree;
// m: shift of such a step, one standard deviation [probed: no figure]
inline constexpr double kWeakShift = 0.05;
// rad: yaw that both views of a step get wrong alike, one standard deviation [probed: no figure]
inline constexpr double kStepYaw = 0.02 * kRadPerDegree;
// m: shift that they get wrong alike, one standard deviation ... [probed: no figure]
inline constexpr double kStepShift = 0.005;
// ... and of the length of the step, added [probed: no figure]
inline constexpr double kStepShiftShare = 0.01;
}  // namespace stem_correction

namespace stem_loops {  // graph/loops/stem_loops.cc
// L0: stems of neighbouring views nearer than that are one [chosen]
inline constexpr double kMergeL0 = 0.2;
// Of the views around that lie near enough to see a stem: fewer see what is none [tuned on the
// spoilt copies of Wild-Places V-03]
inline constexpr double kSeenShare = 0.25;
// views around a place, to each side, among which the nearest one is looked for [chosen]
inline constexpr int kNeighbourhood = 30;
// Factor on the covariance of ICP [probed: no figure]
inline constexpr double kLoopVariance = 9.0;
// rad: tilt of a loop, one standard deviation [probed: no figure]
inline constexpr double kLoopTilt = 0.5 * std::numbers::pi / 180.0;
// rad: yaw that both views of a loop get wrong alike, one standard deviation [probed: no figure]
inline constexpr double kLoopYaw = 0.1 * std::numbers::pi / 180.0;
// L0: shift that they get wrong alike, one standard deviation [probed: x 0.8 no figure; x 1.25 -1
// loop]
inline constexpr double kLoopShiftL0 = 0.02;
// Of the overlap with the first view: the nearest one is taken if it has that much [probed: x 0.8
// no byte; x 1.25 no figure]
inline constexpr double kNearestOverlap = 0.8;
// Of the least overlap: with less no other view is tried [probed: no byte]
inline constexpr double kHopeless = 0.5;
// Standard deviations by which two views lie nearer than the largest distance [chosen]
inline constexpr double kSureSigmas = 2.0;
// Of the variances of the steps between views laid together: their error as a whole [chosen: three
// times that of a random walk to both sides]
inline constexpr double kGatheredShare = 0.25;
}  // namespace stem_loops

namespace loop_closure {  // graph/loops/loop_closure.cc
// points that rank starts [bound: time]
inline constexpr std::size_t kScoringPoints = 1200;
// m: two results nearer than this are the same place [chosen]
inline constexpr double kSamePlaceM = 1.0;
// rad: and turned by less [chosen]
inline constexpr double kSamePlaceRad = 3.0 * kRadPerDegree;
// Factor on the distance of starts while they are too many [not recorded]
inline constexpr double kStepGrowth = 1.2;
// The same for their headings [not recorded]
inline constexpr double kYawStepGrowth = 1.1;
// Steps of the search: nearer starts are neighbours, if their headings are, too [not recorded]
inline constexpr double kNeighbourSteps = 0.9;
// Steps of the heading: the same [not recorded]
inline constexpr double kNeighbourYawSteps = 1.5;
// Directions in which clouds are shifted for the overlap by chance [bound: time]
inline constexpr int kChanceShifts = 8;
}  // namespace loop_closure

namespace view_cone {  // graph/loops/view_cone.cc
// points spread over a sector to measure an overlap, P0 F8 [chosen]
inline constexpr std::size_t kSamples = 256;
// Share of the stems that lie nearer than a view's range [chosen]
inline constexpr double kRangeShare = 0.9;
// Share of the stems within its sector: false ones may lie anywhere [chosen]
inline constexpr double kAngleShare = 0.98;
// Directions of stems from which on the middle of the sector is looked for [chosen: two of a
// hundred may lie anywhere]
inline constexpr std::size_t kFewestDirections = 100;
// rad: a sector narrower by so much about another direction than the x axis is the one [chosen: a
// sector about x misses by a few degrees, one of a lidar mounted otherwise by 30 and more]
inline constexpr double kClearlyNarrowerRad = 15.0 * std::numbers::pi / 180.0;
}  // namespace view_cone

namespace pair_matching {  // graph/stem_matching/pair_matching.cc
// Outlier ratio of a match at most [chosen]
inline constexpr double kMostOutliers = 0.9;
// Factor on the covariance of ICP [probed: no figure]
inline constexpr double kMatchVariance = 4.0;
// rad: tilt of a match, one standard deviation [docs/method/sparse.md: feet look higher the
// farther they are]
inline constexpr double kMatchTilt = 2.0 * std::numbers::pi / 180.0;
// m: height of a match, one standard deviation [docs/method/sparse.md: with 0.15 m the correction
// made lieksa3 worse in space]
inline constexpr double kMatchHeight = 0.5;
// rad: yaw that both views of a match get wrong alike, one standard deviation [probed: no figure]
inline constexpr double kMatchYaw = 0.03 * std::numbers::pi / 180.0;
// L0: shift that they get wrong alike, one standard deviation [probed: no figure]
inline constexpr double kMatchShiftL0 = 0.02;
}  // namespace pair_matching

namespace tree_pattern {  // graph/stem_matching/tree_pattern.cc
// Stems of a view at most [bound: 16 bits]
inline constexpr std::size_t kMostStems = 65'535;
// L0: side of a triangle at least; small triangles look alike [chosen]
inline constexpr double kShortestSide = 1.0;
// Triangles that have to agree on a place [probed: no byte]
inline constexpr int kFewestVotes = 3;
// Cells of the heading in which triangles vote [chosen: 15 degrees]
inline constexpr int kYawCells = 24;
}  // namespace tree_pattern

namespace blur_change {  // graph/self_correction/blur_change.cc
// Grids on which cells are counted [chosen: on 12 grids beta of lieksa2, seed 24, differs by 1.4 %
// (sd); the mean of 8 changes by less than the parts of a map differ]
inline constexpr int kGrids = 8;
}  // namespace blur_change

namespace correction_methods {  // graph/self_correction/correction_methods.cc
// Share in common that a pair counts with at least [bound: keeps variances finite]
inline constexpr double kLeastOverlap = 0.05;
}  // namespace correction_methods

namespace correction_pairs {  // graph/self_correction/correction_pairs.cc
// views: spacing of the grid of pairs at least [bound: pairs are whole views apart]
inline constexpr double kLeastSpacing = 0.5;
// Factor on the spacing from grid to grid [bound: time]
inline constexpr double kSpacingStep = 0.8;
}  // namespace correction_pairs

namespace expected_gain {  // graph/loops/expected_gain.cc
// L0: stems of joined views that are nearer are one [probed: no figure]
inline constexpr double kGatherL0 = 0.15;
// Factor on the variance of the odometry at least [probed: no figure]
inline constexpr double kLeastScale = 0.1;
// The same at most [probed: no byte]
inline constexpr double kMostScale = 1e4;
}  // namespace expected_gain

}  // namespace understory::graph_constants
