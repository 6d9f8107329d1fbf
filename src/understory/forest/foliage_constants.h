#pragma once

#include <cstddef>

// Numbers of forest/search/density_peaks.cc and foliage_columns.cc that are no settings. What the
// words in brackets mean: stem_constants.h.
namespace understory::foliage_constants {

// m: edge of the cells that points of a slice are counted in [bound: noise of lidars]
inline constexpr double kCellM = 0.02;
// Cells along the side of a block, 8 m [bound: memory]
inline constexpr int kBlockCells = 400;
// Standard deviation of the core of a column, in cells: 2.5 cm [chosen: a thin stem and noise]
inline constexpr double kCoreSpread = 1.25;
// Cells to each side that count for the core [bound: less than 2 % is farther out]
inline constexpr int kCoreCells = 3;
// Cells to each side of the square that a core is compared with, 42 cm wide [chosen]
inline constexpr int kAroundCells = 10;
// Cells to each side in which a core is the densest one [chosen]
inline constexpr int kPeakCells = 2;
// Points of a core at least [chosen]
inline constexpr float kLeastCore = 2.0F;
// Standard deviations by which a core holds more points than its surroundings [tuned on lohja1
// seed 3: with 3 it finds 3 % fewer stems]
inline constexpr double kLeastContrast = 2.0;
// Points of a block of a slice at least [bound: time]
inline constexpr std::size_t kFewestPoints = 4;

// m above the lowest height of the search: there a column begins at most [chosen]
inline constexpr double kFirstWithin = 1.0;
// m of height between the two peaks that a line is drawn through, at least ... [chosen]
inline constexpr double kLeastSpan = 0.75;
// ... and at most [bound: time]
inline constexpr double kMostSpan = 1.5;
// m/m: lean of such a line at most, 8 degrees [chosen]
inline constexpr double kMostSlope = 0.14;
// m that a peak may lie off its line [tuned on lohja1 seed 3]
inline constexpr double kOffLine = 0.035;
// m above the lowest height of the search in which a column has to show ... [chosen: young trees
// end above that]
inline constexpr double kShownWithin = 2.0;
// ... in this share of the slices [tuned on lohja1 seed 3]
inline constexpr double kShownShare = 0.75;
// Contrast of one slice that counts at most [chosen]
inline constexpr double kMostContrast = 10.0;
// m between two columns: a branch beside a stem is none [tuned on lohja1 seed 3]
inline constexpr double kApart = 0.25;
// m: radius that a fit begins with ... [chosen]
inline constexpr double kFirstRadius = 0.02;
// ... and scatter [bound: noise of lidars]
inline constexpr double kFirstScatter = 0.015;
// m beyond the area of a search in which columns are looked for [chosen: they compete]
inline constexpr double kSearchBeyond = 3.0;

// m beyond the surface of a column where foliage begins ... [chosen]
inline constexpr double kFoliageFrom = 0.05;
// ... and m from its axis where it ends [chosen]
inline constexpr double kFoliageTo = 0.5;
// Directions that are asked for foliage [chosen]
inline constexpr std::size_t kSides = 8;
// Thinned points of a direction with foliage at least [tuned on random seeds 1, 4, 9]
inline constexpr int kLeastFoliage = 5;
// Directions with foliage at least [tuned on random seeds 1, 4, 9]
inline constexpr int kLeastSides = 7;
// m of diameter for each metre of the column above breast height, at most. Foliage that is as dense
// as a stem looks thicker [chosen: spruces of open ground have 0.015 to 0.025]
inline constexpr double kMostStout = 0.03;
// m below the end of the slices: a column that ends there goes on [chosen]
inline constexpr double kGoesOnWithin = 0.3;

}  // namespace understory::foliage_constants
