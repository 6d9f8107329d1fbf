#pragma once

// Numbers of forest/trees/tree_heights.cc that are no settings. What the words in brackets mean:
// stem_constants.h.
namespace understory::tree_height_constants {
// m around a stem in which its top is looked for [chosen]
inline constexpr double kCrownReach = 1.5;
// m: edge of the squares that know the stems nearby [chosen]
inline constexpr double kCell = 1.0;
// m without points that a crown may begin after [chosen]
inline constexpr int kLargestGap = 3;
// m over the slices: less is no tree top [chosen]
inline constexpr double kLeastAbove = 1.5;
// m: radius of a stem whose tree may be lower than the slices, at most [chosen]
inline constexpr double kLowTreeRadius = 0.05;
// Decimetres without points that a low tree's crown may have [chosen]
inline constexpr int kLowGap = 5;
// m above breast height over which a stem leans as it does below; farther up it stands upright
// [not recorded]
inline constexpr double kStraight = 6.0;
// m from the axis of a stem: points of its own crown are there up to its top [tuned on random
// seeds 1, 2, 6, 13, 49, 51, 56, 58, 59: 0.4 to 0.8 were tried]
inline constexpr double kCoreRadius = 0.4;
// Decimetres without points there that the top may be followed by [tuned on the same: 3 to 10]
inline constexpr int kCoreGap = 5;
// Points that those decimetres would hold, at least, did the tree go on as below. A sparse lidar
// leaves longer gaps [tuned on the same: 0 to 12]
inline constexpr int kCoreExpected = 12;
// Decimetres below that tell it [chosen]
inline constexpr int kBelowCore = 20;
// m from a stem to a neighbour whose crown may reach over it [tuned on the same: 2.5 and 4]
inline constexpr double kOvertopReach = 4.0;
// Share of the neighbour's diameter that the tree's is below [tuned on the same: 0.7 to 1.2]
inline constexpr double kThicker = 0.85;
// Least share of the points above the end of the axis that lie near it, if the crown goes on
// [tuned on the same, 0.03 to 0.3. On treels/pine_plot trees as high as their neighbours have 0.13
// and more]
inline constexpr double kOwnCrownShare = 0.1;
// m that a neighbour reaches higher than the tree, at least ... [chosen: what a height errs by]
inline constexpr double kLeastOver = 0.6;
// ... and as a share of that height. Tops of high trees bend away from the axis of their foot
// [tuned on the same and on spanner's MLS cloud: a tree of 20 m bends by 0.8 m there]
inline constexpr double kLeastOverShare = 0.08;
// Height over diameter of a tree below its neighbours, at least. Forked and broad crowns have no
// points at the axis: they would become stout [tuned on the same: 50 to 70; there 90 is usual]
inline constexpr double kLeastSlenderness = 50.0;
}  // namespace understory::tree_height_constants
