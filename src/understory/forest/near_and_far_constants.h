#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

// Numbers of forest/near_and_far.cc that are no settings. What the words in brackets mean:
// stem_constants.h.
namespace understory::near_and_far_constants {
// m: ends of the classes of range [chosen: a fifth wide]
inline constexpr std::array<double, 10> kClassEnds = {8.0,  12.0, 16.0, 20.0, 25.0,
                                                      30.0, 36.0, 44.0, 54.0, 66.0};
// m: a far range at least [chosen: nearer, beams add little]
inline constexpr double kLeastRange = 15.0;
// Times the mean range of all points that a far one has to be [tuned on `random` 5, 9, 16: 1.3 to
// 1.6]
inline constexpr double kFarTimes = 1.3;
// Points of a class on a stem [chosen: min_returns of the search]
inline constexpr std::int64_t kLeastPoints = 25;
// m from the surface of a stem: points on it [chosen: beams of 40 m are half as wide]
inline constexpr double kOnSurface = 0.1;
// m from the surface: points that a search has to know [bound: stem_fit::kRefineReach and a fit]
inline constexpr double kSurroundings = 0.75;
// m between the centres of two fits of one stem [chosen]
inline constexpr double kSamePlace = 0.3;
// m: edge of the squares in which stems are looked up [bound: time]
inline constexpr double kCell = 1.0;
// Stems that are looked at [bound: memory and time]
inline constexpr std::size_t kMostStems = 200;
// Points that a thinner gathers at first [bound: memory]
inline constexpr std::size_t kFirstLimit = 65'536;
}  // namespace understory::near_and_far_constants
