#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

// The fitted and chosen numbers of forest/stand that are no settings. One namespace for each file
// that uses them. A comment gives the unit (none: a plain number), the meaning, and in brackets
// where the number comes from, in the words of forest_constants.h.
namespace understory::forest_constants {

namespace seen_area {  // forest/stand/seen_area.cc
// m: a cell of the area that was seen [chosen]
inline constexpr double kCell = 0.25;
// m above the ground (or below): returns from here on show that it was reached [chosen]
inline constexpr double kLowest = -0.5;
// Cells: gaps between returns up to twice as wide are filled; a wider one is a shadow [chosen]
inline constexpr int kFill = 2;
// Cells: the same where returns are denser [chosen]
inline constexpr int kFillDense = 1;
// Returns in half of the cells around: gaps are narrow, as five cells stay empty by chance once in
// 500 million [bound: statistics]
inline constexpr std::uint8_t kNarrowGaps = 4;
// Returns in half of the cells around: a cell stays empty by chance once in 3,000 [bound:
// statistics]
inline constexpr std::uint8_t kNoGaps = 8;
// Cells on each side of one: a square of 2.25 m, in which the density is judged [chosen]
inline constexpr int kAround = 4;
// Share of the cells of the square that hold so many returns as are asked for [chosen: the median]
inline constexpr double kDenseShare = 0.5;
// m along the path between two places that are looked from [chosen]
inline constexpr double kStep = 1.0;
// Directions of a look: 0.5 degrees, 13 cm at 15 m [chosen]
inline constexpr int kDirections = 720;
}  // namespace seen_area

namespace height_curve {  // forest/stand/height_curve.cc
// Heights that a curve needs at least [chosen]
inline constexpr std::size_t kLeastHeights = 8;
// The thickest of these trees over the thinnest: with less the curve is not known [chosen]
inline constexpr double kLeastSpread = 1.2;
// Rounds of the start [bound: it settles sooner]
inline constexpr int kStartRounds = 30;
// Rounds of the fit [bound: it settles sooner]
inline constexpr int kRounds = 100;
// Of the mean ratio: smaller residuals of the start count alike [chosen]
inline constexpr double kLeastResidual = 1e-4;
// m: scatter of single heights about a curve, at least [chosen]
inline constexpr double kLeastScatter = 0.3;
// Standard deviation over the median of absolute residuals, of normal ones [bound: statistics]
inline constexpr double kMedianToSd = 1.4826;
// Standard deviations over the curve: higher trees do not count. Normal errors then have 95 % of
// the efficiency of least squares [bound: statistics]
inline constexpr double kFarOff = 4.685;
// Of the full heights: the start lies above so many of them [chosen; random seeds 4, 9, 16 and
// handheld seed 3: 0.75 to 0.93 give the same curve]
inline constexpr double kStartQuantile = 0.85;
// Of the mean height: scatter of single heights about a curve, at most [chosen; simulated stands
// have 0.06]
inline constexpr double kMostScatter = 0.07;
// Beforehand: share of the trees whose top is called seen that end there. On random seeds 16 and 9
// it is 0.17 and 0.83 [chosen]
inline constexpr double kSeenThatEnd = 0.5;
// Beforehand: share of the lower bounds that are the tree's height all the same [chosen]
inline constexpr double kBoundsThatEnd = 0.3;
// So many trees are as sure as these shares [tuned: random seeds 4, 9, 16 and handheld seed 3]
inline constexpr double kShareTrees = 30.0;
// Parts of a step: shorter ones are not tried [bound: speed]
inline constexpr double kLeastStep = 1e-3;
// Of `a`: a step does not make it smaller than this [chosen]
inline constexpr double kLeastA = 0.2;
}  // namespace height_curve

namespace stand_trees {  // forest/stand/stand_trees.cc
// m: standard deviation of a height whose top was seen [docs/method/forest.md: median error 0.49 m]
inline constexpr double kHeightSd = 0.7;
// Volumes that a form factor needs at least [chosen]
inline constexpr std::size_t kLeastVolumes = 5;
}  // namespace stand_trees

namespace stand_figures {  // forest/stand/stand_figures.cc
// m2 of a hectare [bound: unit]
inline constexpr double kHectare = 10'000.0;
// Stems per hectare that make the dominant height [bound: its definition]
inline constexpr double kDominantPerHa = 100.0;
// Fewer of them on a plot give no dominant height [chosen]
inline constexpr double kLeastDominant = 3.0;
// Standard deviations of its place: farther from the border a tree's side is certain [chosen]
inline constexpr double kFarSides = 4.0;
}  // namespace stand_figures

}  // namespace understory::forest_constants
