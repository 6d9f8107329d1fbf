#pragma once

#include <cstddef>
#include <cstdint>

// The fitted and chosen numbers of the layer `evaluation` that are no settings, which stand in the
// Config structs. One namespace for each file that uses them. A comment gives the unit (none: a
// plain number), the meaning, and in brackets where the number comes from:
//   chosen   by judgement, fitted to nothing
//   bound    by physics, geometry, statistics, memory or time
//   tuned    on the recordings named; where none are, on simulated ones with seeds up to 19
//   not recorded   in use for long, and nothing tells why it is this number
// or real clouds and measurements by their page.
namespace understory::evaluation_constants {

namespace tree_match_chance {  // evaluation/trees/tree_match_chance.cc
// Copies that are mirrored and aligned anew [bound: time]
inline constexpr std::size_t kSearchedCopies = 3;
// Copies that are shifted [bound: time]
inline constexpr std::size_t kShiftedCopies = 16;
// Standard deviations above the copies from which on two maps are of one stand [110 pairs of maps,
// docs/method/sparse.md]
inline constexpr double kLeastSigmas = 4.0;
// The same of the correlation of diameters [110 pairs of maps, docs/method/sparse.md]
inline constexpr double kLeastDiameterSigmas = 4.0;
// Pairs at least for two maps of one stand [not recorded]
inline constexpr std::size_t kLeastPairs = 5;
// Pairs with diameters that give a correlation at least [not recorded]
inline constexpr std::size_t kLeastDiameters = 8;
// Radii of a pair by which a copy is shifted at least: farther than a tree is looked for [bound:
// geometry]
inline constexpr double kLeastShift = 2.0;
// The same at most: the overlap stays [bound: geometry]
inline constexpr double kMostShift = 5.0;
// m: spread of diameters that tells a correlation at least [not recorded]
inline constexpr double kLeastSpreadM = 0.005;
}  // namespace tree_match_chance

namespace tree_matching {  // evaluation/trees/tree_matching.cc
// Cost of a pair for its diameters where one of them is unknown; 0 to 1 else [chosen: half way, so
// that a tree whose diameter fits comes first, and one whose diameter does not comes last]
inline constexpr double kUnknownDiameterCost = 0.5;
// Cost of a tree without a partner: that of the worst pair [chosen: no two near trees are left]
inline constexpr double kUnmatchedCost = 2.0;
}  // namespace tree_matching

namespace tree_class_errors {  // evaluation/trees/tree_class_errors.cc
// Classes of diameter at most; larger diameters are in another unit [bound: memory and a table that
// can be read]
inline constexpr double kMostClasses = 1000.0;
// Of a class: a diameter so near below its border counts as on it, as 0.3 / 0.1 does [bound:
// rounding]
inline constexpr double kOnTheBorder = 1e-9;
}  // namespace tree_class_errors

namespace tree_changes {  // evaluation/trees/tree_changes.cc, epoch_area.cc
// Standard deviations beyond which an increment is significant [bound: 95 % of normal errors]
inline constexpr double kSignificance = 1.96;
// Trees that tell a spread or a quantile at least [chosen]
inline constexpr std::size_t kLeastTrees = 8;
// Share of the trees of OLD that are thinner than what it lists reliably [chosen]
inline constexpr double kThinShare = 0.05;
// Share of the increments that are below the fastest growth [chosen: single wrong pairs are beyond]
inline constexpr double kFastShare = 0.98;
// Share of the trees that stand within the reach of a scan [chosen: beyond it trees are missed more
// often]
inline constexpr double kReachShare = 0.9;
// m: the least reach that is tried [bound: handheld scanners]
inline constexpr double kLeastReachM = 3.0;
// m: the largest [bound: lidars that reach 200 m]
inline constexpr double kMostReachM = 200.0;
// Ratio of one reach to the next [chosen: a tenth]
inline constexpr double kReachStep = 1.1;
// Share of the thick trees of NEW that OLD missed, above which the lists do not fit together
// [chosen: a scan that misses half of the thick trees lists no stand]
inline constexpr double kMostMissedShare = 0.5;
// m: places of a path are that far apart [chosen: small beside a reach]
inline constexpr double kPathStepM = 0.5;
}  // namespace tree_changes

namespace tree_errors {  // evaluation/trees/tree_errors.cc
// m: no tree is thicker at breast height [bound: the thickest known one, a cypress of 11.6 m]
inline constexpr double kThickestTreeM = 12.0;
// m: no z of a tree is lower, with z up or down; -9999 stands for an unknown one [bound: the
// highest mountain]
inline constexpr double kLowestGroundM = -9000.0;
}  // namespace tree_errors

namespace tree_list_check {  // evaluation/trees/tree_list_check.cc
// m: no stand has a larger median of diameters; groves of giant sequoias come near it [bound:
// forests]
inline constexpr double kThickestMedianM = 3.0;
// m: nor a smaller one: thinner stems have no diameter at breast height that counts [bound:
// forests]
inline constexpr double kThinnestMedianM = 0.01;
// Medians above it are millimetres: as centimetres they were above kThickestMedianM or near it
// [chosen]
inline constexpr double kThickestCentimetres = 120.0;
// Diameters, or pairs of them, that tell anything at least [chosen]
inline constexpr std::size_t kLeastKnown = 5;
// Largest median ratio of the diameters of two lists of one stand. Two methods differ by 1.4 where
// one sees stems from afar; radii differ by 2, feet by 3.3 [bound: between 1.4 and 2]
inline constexpr double kMostRatio = 1.8;
// m: two stems do not stand so near each other [bound: the thinnest stems; four lists of real plots
// have 3 such rows in 5,268]
inline constexpr double kOneStemM = 0.05;
// Doubled rows at least [chosen: forks]
inline constexpr std::size_t kLeastDoubles = 3;
// Share of doubled rows at most [chosen: forks]
inline constexpr double kMostDoubles = 0.02;
// Share of the trees at one place whose diameter or height differs, at most, for a copy [chosen:
// a few rows corrected by hand; of trees measured anew to a centimetre far more differ in a year]
inline constexpr double kMostAnew = 0.05;
}  // namespace tree_list_check

namespace tree_alignment {  // evaluation/trees/tree_alignment.cc
// m between two trees of one list that are tried as a pair at least. Long pairs fix the heading
// better and are rarer, short ones are more often both within the other list [chosen: suits plots
// and strip roads]
inline constexpr double kMinPairM = 4.0;
// m between them at most [chosen: suits plots and strip roads]
inline constexpr double kMaxPairM = 25.0;
// Pairs of the first list that are tried at most [bound: time]
inline constexpr std::size_t kMaxPairsOfA = 400;
// Motions that are tried at most [bound: time]
inline constexpr std::size_t kMaxHypotheses = 200'000;
// Trees of a list in which every n-th tells how good a motion is [bound: time]
inline constexpr std::size_t kMany = 5'000;
// How many of such a list do [bound: time]
inline constexpr std::size_t kCountedOfMany = 1'000;
// Trees that have to lie on trees at least [bound: two are a pair that was tried]
inline constexpr std::size_t kMinMatches = 3;
// Steps of the last fit at most [bound: convergence]
inline constexpr int kMaxIterations = 20;
}  // namespace tree_alignment

}  // namespace understory::evaluation_constants
