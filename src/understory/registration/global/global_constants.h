#pragma once

#include <array>
#include <cstddef>

// The fitted and chosen numbers of registration/global, in the form of registration_constants.h,
// whose words in brackets hold here, too.
namespace understory::registration_constants {

namespace level_cloud {  // registration/global/level_cloud.cc
// m: edges of the cells whose shape tells where up is: a stem's width and a few rings [chosen]
inline constexpr double kCellEdges[] = {0.8, 1.6};
// points of such a cell at least [chosen]
inline constexpr int kCellPoints = 5;
// points of a cell that count at most: near stems hold many [chosen]
inline constexpr int kMostWeight = 30;
// Middle over largest variance: below, a line [chosen]
inline constexpr double kLineShare = 0.1;
// Smallest over middle variance: below, a surface [chosen]
inline constexpr double kPlaneShare = 0.1;
// Sine of the angle from up within which a hint counts, round by round: 40 to 5 degrees [chosen]
inline constexpr double kSines[] = {0.64, 0.42, 0.26, 0.17, 0.12, 0.09, 0.09};
// points in hints: with fewer nothing tells where up is [chosen]
inline constexpr double kLeastWeight = 60.0;
// Second over third eigenvalue of what the hints rule out: below, up is open about an axis [chosen]
inline constexpr double kOpenTurn = 0.05;
// Cosine of up against z: 40 degrees [chosen]
inline constexpr double kLeastCosine = 0.766;
// m from the origin: farther points are no points [bound: voxel keys]
inline constexpr float kFarthest = 1e5F;
// m: edge of the ground at most [bound: memory]
inline constexpr float kMostCells = 2000.0F;
// Steepest rise of the ground [chosen]
inline constexpr float kSteepest = 0.6F;
}  // namespace level_cloud

namespace uprights {  // registration/global/uprights.cc
// m above the ground where slices begin [chosen]
inline constexpr float kLowest = 0.7F;
// m: height of a slice; rings of 16 beams lie so far apart at 14 m [chosen]
inline constexpr float kSlice = 0.5F;
// Number of slices [chosen]
inline constexpr int kSlices = 13;
// m: edge of a column [chosen]
inline constexpr float kEdge = 0.2F;
// Columns beside in a slice in which a thing still stands alone [chosen]
inline constexpr int kMostBeside = 4;
// Slices of a column itself, and slices in which it stands alone, of an upright [chosen]
inline constexpr int kLeastOwnLevels = 2;
// The next of these [chosen]
inline constexpr int kLeastLevels = 4;
// Slices from which on the nearer upright is the better one [chosen]
inline constexpr int kEnoughLevels = 7;
// m: nearer things are one [chosen]
inline constexpr double kOnePlace = 0.7;
}  // namespace uprights

namespace range_view {  // registration/global/range_view.cc
// m: nearer returns are the carrier's [chosen]
inline constexpr float kNearest = 0.5F;
// m: farther points are none of a lidar [chosen]
inline constexpr float kFarthest = 2000.0F;
// points that make the view at most [bound: time]
inline constexpr std::size_t kMostPoints = 400000;
// Range of a point over that of the nearest of its pixel: below, they are at one range [chosen]
inline constexpr float kOneRange = 1.2F;
// Share of the points at one range, and number of those that tell, of a single view. Scans of 16 to
// 128 rings have 0.56 to 0.98, maps of six scans 0.52 and less [tuned: forest, handheld, evo1,
// harvester and lohja1 seed 2, and the Newer College and KITTI scans]
inline constexpr double kOneViewShare = 0.54;
// The next of these [chosen]
inline constexpr double kFewestOthers = 200.0;
// Pixels of the nine around a direction that show something at least [chosen]
inline constexpr int kLeastSeen = 3;
// m, and share of the range, by which a point lies clearly before what was seen [chosen]
inline constexpr float kMargin = 0.5F;
// The next of these [chosen]
inline constexpr float kMarginShare = 0.03F;
}  // namespace range_view

namespace upright_search {  // registration/global/upright_search.cc
// m: how far apart the two uprights of a pair are; nearer ones tell no heading [chosen]
inline constexpr double kShortest = 4.0;
// The next of these [chosen]
inline constexpr double kLongest = 16.0;
// m: lengths of pairs that are nearer may be one [chosen]
inline constexpr double kLengthTolerance = 0.18;
// m, and per m of length: difference in rise of the ground [chosen]
inline constexpr double kRise = 2.0;
// The next of these [chosen]
inline constexpr double kRisePerM = 0.1;
// Cells of heading, 2 degrees each; m: edge of cells of place; m: beyond the target [chosen]
inline constexpr int kHeadings = 180;
// The next of these [chosen]
inline constexpr double kCell = 0.8;
// The next of these [chosen]
inline constexpr double kMargin = 20.0;
// Cells of place a side at most [bound: memory]
inline constexpr int kMostColumns = 400;
// Fullest cells whose neighbours are counted; starts fitted of them [chosen]
inline constexpr std::size_t kCellsLookedAt = 3000;
// The next of these [chosen]
inline constexpr std::size_t kStarts = 80;
// m: reach of a partner, round by round [chosen]
inline constexpr std::array<double, 4> kReaches = {1.2, 0.9, 0.6, 0.4};
// m: rises of the ground of pairs that agree [chosen]
inline constexpr double kSameRise = 0.8;
// What a pair counts whose rise differs: hidden ground makes heights unsure [chosen]
inline constexpr double kOtherRise = 0.6;
// uprights of a cloud at least [bound: two determine the motion]
inline constexpr std::size_t kFewest = 4;
// rad, m: nearer motions are one [chosen]
inline constexpr double kSameTurn = 0.05;
// The next of these [chosen]
inline constexpr double kSamePlace = 0.7;
}  // namespace upright_search

namespace feature_search {  // registration/global/feature_search.cc
// m: radius of a spin image, and its heights from the place of the feature [chosen: a room's corner
// and what is beside it]
inline constexpr float kRadius = 3.0F;
// The next of these [chosen]
inline constexpr float kLowest = -2.0F;
// The next of these [chosen]
inline constexpr float kHighest = 4.0F;
// m above the ground: features stand higher [chosen]
inline constexpr float kAbove = 0.5F;
// m: features are so far apart [chosen]
inline constexpr double kSpacing = 0.5;
// m: points nearer than this tell corners and ends. Then: least number of them, distance of the
// mean from an end as a share of the first, narrow over wide variance of a corner [chosen]
inline constexpr float kNear = 1.5F;
// The next of these [chosen]
inline constexpr double kFewestAround = 12.0;
// The next of these [chosen: half of a wall that ends has its mean half as far away]
inline constexpr double kEndShare = 0.3;
// The next of these [chosen]
inline constexpr double kCornerRatio = 0.1;
// m: two pairs are consistent if lengths and rises differ by less; shorter ones tell no heading
// [chosen: half the spacing of features]
inline constexpr double kSameLength = 0.4;
// The next of these [chosen]
inline constexpr double kSameRise = 0.6;
// The next of these [chosen]
inline constexpr double kShortest = 2.0;
// Fits, and the pairs that begin one beside its seed; rounds of a fit [chosen]
inline constexpr std::size_t kSeeds = 40;
// The next of these [chosen]
inline constexpr std::size_t kFriends = 9;
// The next of these [chosen]
inline constexpr int kRounds = 4;
// m: pairs that lie on each other; fewest of a motion [chosen]
inline constexpr double kReach = 0.6;
// The next of these [chosen]
inline constexpr int kFewestMatched = 5;
// m, rad: nearer motions are one [as upright_search]
inline constexpr double kSamePlace = 0.7;
// The next of these [as upright_search]
inline constexpr double kSameTurn = 0.05;
}  // namespace feature_search

namespace search_cloud {  // registration/global/search_cloud.cc
// m: edge of the voxels that thin a cloud [chosen]
inline constexpr double kVoxel = 0.2;
// points of a thinned cloud at least [chosen]
inline constexpr std::size_t kFewestPoints = 200;
// m: half of the points lie nearer to one of them [chosen]
inline constexpr float kWidest = 3000.0F;
// m above the ground: plants stand higher, the ground lies lower [chosen]
inline constexpr float kAbove = 0.6F;
// The next of these [chosen]
inline constexpr float kOnGround = 0.3F;
// points that tell how well a pose fits [chosen]
inline constexpr std::size_t kPlants = 3000;
// The next of these [chosen]
inline constexpr std::size_t kGround = 700;
// uprights that vote [bound: time grows with the fourth power]
inline constexpr std::size_t kUprights = 180;
// m by which the middle of a stem lies behind what one lidar sees of it [chosen: pi/4 of a radius]
inline constexpr double kBehind = 0.08;
// points of a cloud below which its rings are few, and fewest points of a cell then [as
// ndt_matcher::kSparseMinPoints]
inline constexpr std::size_t kFewRings = 35000;
// The next of these [chosen]
inline constexpr int kSparseCell = 4;
// m: edge of the cells that tell what is near, a point and those around it [chosen]
inline constexpr float kNearEdge = 0.4F;
// m: half of the width and height of that grid at most [bound: memory]
inline constexpr float kHalfWidth = 200.0F;
// The next of these [bound]
inline constexpr float kHalfHeight = 60.0F;
// m: cells and least thickness of NDT [chosen, as of the command register]
inline constexpr double kCoarseCell = 2.0;
// The next of these [chosen, as of the command register]
inline constexpr double kMiddleCell = 1.0;
// The next of these [chosen, as of the command register]
inline constexpr double kFineCell = 0.5;
// The next of these [chosen, as of the command register]
inline constexpr double kThinnest = 0.03;
}  // namespace search_cloud

namespace tilt_and_height {  // registration/global/tilt_and_height.cc
// m around an upright whose points tell how it leans, and their heights above the ground [chosen]
inline constexpr double kReach = 0.5;
// The next of these [chosen]
inline constexpr float kLowest = 0.5F;
// The next of these [chosen]
inline constexpr float kHighest = 10.0F;
// m beside the line through a stem: farther points are branches [chosen: thick stems]
inline constexpr double kBeside = 0.25;
// points of a stem at least, and m: standard deviation of their heights at least [chosen]
inline constexpr double kFewestPoints = 4.0;
// The next of these [chosen]
inline constexpr double kLeastHeightSd = 0.4;
// m: deviation of points of a stem from its line; lean per m that stems bend besides [chosen]
inline constexpr double kPointSd = 0.05;
// The next of these [chosen]
inline constexpr double kLeanSd = 0.005;
// Lean of a stem at most [chosen: 20 degrees]
inline constexpr double kMostLean = 0.36;
// m: stems that are nearer meet [as pose_evidence]
inline constexpr double kMet = 0.35;
// Standard deviations at which a residual counts half, in the last rounds. Then how much wider the
// first round is, and by how much each next one narrows [tuned: harvester and lohja1 seed 11]
inline constexpr double kCauchy = 0.8;
// The next of these [tuned]
inline constexpr double kWidest = 8.0;
// The next of these [tuned]
inline constexpr double kNarrower = 0.6;
// m above the ground of what is on it [as search_cloud]
inline constexpr float kOnGround = 0.3F;
// m: ground of both clouds that is nearer is compared [chosen]
inline constexpr double kNear = 0.7;
// m, and m per m: deviation of a square metre of ground, and of its slope [chosen]
inline constexpr double kGroundSd = 0.08;
// The next of these [chosen]
inline constexpr double kSlopeSd = 0.15;
// squares around one whose ground tells its slope; weight of level ground there, m2 [chosen]
inline constexpr int kSlopeReach = 4;
// The next of these [chosen]
inline constexpr double kLevelWeight = 20.0;
// Share of the ground that counts as independent: what is hidden is off alike over many squares,
// and would tilt the source [tuned: harvester and lohja1 seed 11]
inline constexpr double kGroundShare = 0.02;
// rad: how far level frames are tilted against each other [tuned: harvester and lohja1 seed 11]
inline constexpr double kLevelSd = 0.03;
// 1/m2 that keeps the height where no ground is shared [bound]
inline constexpr double kHeightFloor = 1e-3;
// Rounds of least squares, by leans alone and then with the ground [chosen]
inline constexpr int kLeanRounds = 6;
// The next of these [chosen]
inline constexpr int kRounds = 6;
// m: steps between rises of the source that are tried, and their number to either side [chosen:
// hidden ground is off by up to 3 m]
inline constexpr double kRiseStep = 0.1;
// The next of these [chosen]
inline constexpr int kRiseSteps = 30;
// stems that meet at least for a fit that counts [chosen: more than meet by chance]
inline constexpr int kFewestAxes = 8;
// A direction with a smaller share of the strongest information is open [as NdtConfig]
inline constexpr double kDegenerateRatio = 0.003;
}  // namespace tilt_and_height

namespace pose_evidence {  // registration/global/pose_evidence.cc
// points of a quick look [bound: time]
inline constexpr std::size_t kQuickPoints = 600;
// points whose places are looked at, and whose voxels are, for the evidence [bound: time]
inline constexpr std::size_t kLookPoints = 1500;
// The next of these [bound]
inline constexpr std::size_t kFinePoints = 1500;
// m, rad: poses beside the one that is weighed [chosen: two voxels; the same at 8 m]
inline constexpr double kAside = 0.4;
// The next of these [chosen]
inline constexpr double kTurnAside = 0.05;
// Curvature of the share of voxels below which it has no top [chosen]
inline constexpr double kLeastCurve = 0.01;
// m: uprights that are nearer meet; radius in which their density is counted [chosen]
inline constexpr double kMet = 0.35;
// The next of these [chosen]
inline constexpr double kAround = 6.0;
}  // namespace pose_evidence

namespace global_match {  // registration/global/global_match.cc
// Poses looked at, and those refined of them [bound: time]
inline constexpr std::size_t kCandidates = 24;
// The next of these [bound]
inline constexpr std::size_t kRefined = 3;
// Score below which local features are sought, too [chosen: below nearly all right answers of seeds
// 11 and 12]; most features [bound: time]
inline constexpr double kPoorScore = 0.5;
// The next of these [bound]
inline constexpr std::size_t kFeatures = 700;
// points above the ground that refine a pose, and those that take its last steps [bound: time]
inline constexpr std::size_t kFewPlants = 1500;
// The next of these [bound]
inline constexpr std::size_t kLastPoints = 8000;
// Score below which other heights are tried [chosen: some 60 % overlap]
inline constexpr double kSureScore = 1.2;
// m by which the source is raised then [chosen: the ground is off by up to a metre where hidden]
inline constexpr double kHeights[] = {-1.4, -0.7, 0.7, 1.4};
// m: place of one upright, and how far uprights spread: the weight of their motion beside NDT
// [chosen]
inline constexpr double kUprightSd = 0.12;
// The next of these [chosen]
inline constexpr double kSpread = 10.0;
// rad: how far the level frames may be tilted against each other; the weight of that beside NDT
// [tuned: harvester seeds 3 and 4]
inline constexpr double kLevelSd = 0.005;
// The same in the last steps, where dense scans tell it better [tuned: handheld OS1-64 seed 4]
inline constexpr double kLastLevelSd = 0.01;
// The same where something else tells the tilt [bound: none]
inline constexpr double kNoLevelSd = 1e3;
// uprights that tell anything beside NDT at least [chosen]
inline constexpr int kFewestUprights = 6;
// m, rad: nearer poses are one [chosen]
inline constexpr double kSamePose = 1.0;
// The next of these [chosen]
inline constexpr double kSameHeading = 0.07;
}  // namespace global_match

namespace match_verdict {  // registration/global/match_verdict.cc
// Weights of the logistic regression: constant, near, log of seen through over near, log of fine
// over aside. Then log of matched over chance, and gap to the rival [tuned: by
// benchmarks/registration/fit_verdict.py on seeds 3 to 5]
inline constexpr std::array<double, 6> kWeights = {-16.75, 12.16, -1.28, 5.45, 0.30, 2.00};
// The same between single scans of which one has few rings. They have fewer voxels in common, and
// their tilt and height are of belief_of_sparse [tuned: harvester, lieksa2 and lohja1 seeds 11, 12]
inline constexpr std::array<double, 6> kSparseWeights = {-9.79, 9.50, -1.09, 4.23, 0.35, 3.27};
// m: standard deviation of the place of such a match at most [tuned: the same seeds]
inline constexpr double kMostSparseSd = 0.15;
// Floors of the shares in the logarithms [chosen: a few of 1500 points]
inline constexpr double kThroughFloor = 0.003;
// The next of these [chosen]
inline constexpr double kNearFloor = 0.02;
// The next of these [chosen]
inline constexpr double kFineFloor = 0.003;
// The logarithm that stands for clouds that are no single views [chosen: between right and wrong]
inline constexpr double kUsualThrough = -3.0;
// Bounds of the gap, and the gap where there is no rival [chosen]
inline constexpr double kLeastGap = -0.5;
// The next of these [chosen]
inline constexpr double kMostGap = 1.0;
// The next of these [chosen]
inline constexpr double kNoRival = 0.7;
// Chance from which on a pose is trusted [chosen]
inline constexpr double kTrusted = 0.95;
// m, degrees by which small cells may move a trusted pose on [chosen]
inline constexpr double kMostMoved = 0.25;
// The next of these [chosen]
inline constexpr double kMostTurned = 1.5;
// points above the ground of a cloud that can be judged [chosen]
inline constexpr std::size_t kFewestPlants = 100;
// What reasons name: gap to a rival; seen through over near; near; fine over aside [chosen]
inline constexpr double kRivalGap = 0.1;
// The next of these [chosen]
inline constexpr double kMuchThrough = 0.1;
// The next of these [chosen]
inline constexpr double kLittleNear = 0.3;
// The next of these [chosen]
inline constexpr double kLittleSharper = 1.5;
}  // namespace match_verdict

}  // namespace understory::registration_constants
