#pragma once

#include <cstddef>
#include <cstdint>

// The numbers of the search for dead wood that are no settings, in the form of forest_constants.h.
namespace understory::forest_constants {

namespace dead_wood {  // forest/dead_wood/dead_wood.cc
// m above the terrain: lower points are ground ... [chosen]
inline constexpr double kLowest = 0.05;
// ... and the highest that decide whether a stump ends [bound: the highest one, and 0.8 m that are
// empty]
inline constexpr double kHighestLow = 2.3;
// m: edge of a cube with one point [chosen: the noise of a scanner]
inline constexpr double kCube = 0.02;
}  // namespace dead_wood

namespace stump_search {  // forest/dead_wood/stump_search.cc
// m: a stump is no higher [chosen: higher ones are snags]
inline constexpr double kHighestStump = 1.0;
// Times its diameter a stump is no higher: posts are [chosen]
inline constexpr double kSlenderest = 5.0;
// m: lower ones do not tell themselves from roots and stones [chosen]
inline constexpr double kLowestStump = 0.12;
// m: thickness of a slice [chosen]
inline constexpr double kSlice = 0.08;
// m: circles are searched up to here: higher stumps have some below [bound: time]
inline constexpr double kHighestCircle = 0.56;
// Slices of a stump that show a circle, at least [chosen]
inline constexpr std::size_t kLeastSlices = 2;
// m: radii of circles, from here ... [chosen]
inline constexpr double kThinnestStump = 0.04;
// ... to here [chosen]
inline constexpr double kThickestStump = 0.6;
// Points of a circle, at least [chosen]
inline constexpr int kLeastPoints = 6;
// degrees of a circle that its points cover, at least [chosen]
inline constexpr double kLeastArc = 90.0;
// m: centres of circles of one stump are nearer to each other [chosen]
inline constexpr double kApart = 0.06;
// Of the radius: circles of one stump differ by less [chosen]
inline constexpr double kUnlike = 0.25;
// m above the ground: the lowest circle of a stump is lower [chosen]
inline constexpr double kLowestCircle = 0.35;
// m beyond its surface: points that belong to a stump [chosen]
inline constexpr double kStumpBand = 0.03;
// Of the height: higher points may be of a slanting cut or of a worn edge [chosen]
inline constexpr double kWallShare = 0.75;
// m beyond its surface: points that surround it [chosen]
inline constexpr double kSurrounding = 0.25;
// Times as many points around a stump as on it, in the height of the stump: more are foliage
// [chosen]
inline constexpr double kMostAround = 1.0;
// Share of the points above a stump that its top leaves out [chosen]
inline constexpr double kAboveShare = 0.03;
// m: so much above its top a stump has no points [chosen]
inline constexpr double kClearAbove = 0.8;
// Share of the points that may be within the circle, below its top [chosen]
inline constexpr double kMostInside = 0.25;
// Returns of a stump, at least [chosen]
inline constexpr int kLeastReturns = 20;
// m: scatter about the surface, at most [chosen]
inline constexpr double kMostScatterStump = 0.028;
// Points per area around the surface over those on it, at most [chosen]
inline constexpr double kMostOutsideStump = 0.13;
// The same where many points surround it: plants [tuned on random seeds 1, 2, 4-6, 8-10]
inline constexpr double kFewOutsideStump = 0.07;
// Times the points on it that are not many [tuned likewise]
inline constexpr double kFewAround = 0.75;
// The same for the first fit, which is less exact [chosen]
inline constexpr double kFarOutside = 0.2;
// Of the diameter: standard deviation at most [chosen]
inline constexpr double kMostSdStump = 0.4;
// degrees of its circumference that a stump shows, at least [chosen]
inline constexpr double kLeastStumpArc = 110.0;
// The surface of a cylinder is so far up from breast height in the frame of the fit, m [bound: the
// fit holds the radius at breast height]
inline constexpr double kFitRise = 1.0;
// Of the search for circles [chosen]
inline constexpr std::uint64_t kStumpSeed = 11;
}  // namespace stump_search

namespace log_search {  // forest/dead_wood/log_search.cc
// m above the ground: logs are searched up to here [chosen]
inline constexpr double kHighestLog = 1.5;
// m: edge of a square from which one line is started [chosen]
inline constexpr double kSeedCell = 0.5;
// Points in it, at least [chosen]
inline constexpr std::size_t kLeastInCell = 5;
// m along the line to both sides that tell whether it is one [chosen]
inline constexpr double kStartHalf = 0.8;
// Pairs of points that are tried as a line [chosen]
inline constexpr int kDraws = 100;
// Points that a line is tried on, about [bound: time]
inline constexpr std::size_t kEnoughNear = 250;
// m between both points of a pair, at least [chosen]
inline constexpr double kPairApart = 0.35;
// Rise over run of a lying stem, at most [bound: steeper ones lean]
inline constexpr double kSteepest = 0.84;
// m from the line: points of the log [chosen]
inline constexpr double kLineReach = 0.09;
// m from the line: points that surround it [chosen]
inline constexpr double kLineAround = 0.3;
// m: step along the line [chosen]
inline constexpr double kStep = 0.1;
// Steps of a start that hold points, at least [chosen]
inline constexpr int kLeastSteps = 10;
// Share of the points around the line that are near it, at least [chosen]
inline constexpr double kLeastNear = 0.4;
// m: radii that a fit starts with [chosen]
inline constexpr double kFirstRadii[] = {0.05, 0.09, 0.15, 0.25};
// m from the line: points that the first fit sees [chosen]
inline constexpr double kFirstReach = 0.5;
// Weight of a point within a first fit against one on it [chosen]
inline constexpr double kInsideWeight = 2.0;
// m: thickest log [chosen]
inline constexpr double kThickestRadius = 0.4;
// m from the surface: points on it [chosen]
inline constexpr double kLogBand = 0.03;
// m from the surface: points that a fit sees [chosen]
inline constexpr double kFitReach = 0.35;
// m from the surface: points that surround it [chosen]
inline constexpr double kBeside = 0.12;
// Points on a part of the surface, at least [chosen]
inline constexpr int kLeastOn = 4;
// Of those and the points around them [chosen]
inline constexpr double kLeastOnShare = 0.5;
// m: gaps of the surface that are looked beyond [chosen]
inline constexpr double kLongestGap = 0.8;
// m: pieces by which a log grows [chosen]
inline constexpr double kPiece = 0.2;
// m: shorter ones are branches [chosen]
inline constexpr double kShortestLog = 1.5;
// m: what is longer is none, as of what lies beyond the tile no more is seen [bound: reach]
inline constexpr double kLongestLog = 40.0;
// Pieces that hold points, of all [chosen]
inline constexpr double kLeastCovered = 0.75;
// degrees of its circumference that a log shows, at least [chosen]
inline constexpr double kLeastLogArc = 60.0;
// m: sections that are looked at one by one [chosen]
inline constexpr double kSection = 0.4;
// degrees that a section shows: the trace of one laser has no width [chosen]
inline constexpr double kLeastSectionArc = 50.0;
// Of the sections, how many show that at least [chosen]
inline constexpr double kRoundShare = 0.5;
// Times its diameter a log is long, at least [chosen]
inline constexpr double kLeastSlender = 5.0;
// Points inside over points on, at most [chosen]
inline constexpr double kMostInsideLog = 0.15;
// m: scatter about the surface, at most [chosen]
inline constexpr double kMostLogScatter = 0.025;
// Points per area around the surface over those on it, at most [chosen]
inline constexpr double kMostOutside = 0.07;
// Times the standard deviation that a fit with free points has [tuned on random seeds 1, 2, 4-6,
// 8-10]
inline constexpr double kSdTimes = 1.5;
// m: how a log differs from a cone, as a standard deviation of its diameter [tuned likewise]
inline constexpr double kFormSd = 0.015;
// Of the diameter: standard deviation at most [chosen]
inline constexpr double kMostDiameterSd = 0.25;
// m above the ground: one part of a log lies lower [chosen]
inline constexpr double kLyingBelow = 0.3;
// m beyond the surface of a stem: its points [chosen]
inline constexpr double kStemMargin = 0.1;
// Of the search for lines [chosen]
inline constexpr std::uint64_t kLogSeed = 12;
}  // namespace log_search

}  // namespace understory::forest_constants
