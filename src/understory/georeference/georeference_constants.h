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

namespace gnss_fit {  // georeference/gnss_fit.cc
// s between poses beyond which no place is interpolated [chosen]
inline constexpr double kGapS = 2.0;
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
inline constexpr double kLeastWidthM = 0.05;
}  // namespace terrain_fit

namespace path_fit {  // georeference/path_fit.cc
// degrees: motions that differ by more are different answers [chosen]
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
}  // namespace path_fit

namespace terrain_file {  // georeference/terrain_file.cc
// cells of a region at most: larger than any run [bound: memory]
inline constexpr double kMostCells = 1e8;
}  // namespace terrain_file

}  // namespace understory::georeference_constants
