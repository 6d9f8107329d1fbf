#pragma once

#include <cstddef>

// The numbers of crowns that are no settings, in the form of forest_constants.h.
namespace understory::forest_constants {

namespace tree_crowns {  // forest/trees/tree_crowns.cc
// m: height of the layers of a crown [chosen]
inline constexpr double kLayer = 0.5;
// Directions in which the width of a layer is measured [chosen]
inline constexpr std::size_t kSectors = 16;
// Directions from one with points to the next: wider gaps are no part of the crown [chosen]
inline constexpr std::size_t kWidestGap = 5;
// m beyond the surface of the stem: what reaches farther is a branch [chosen]
inline constexpr double kBranch = 0.35;
// Quantile of the widths of the layers that is the width of a tree [chosen]
inline constexpr double kWideQuantile = 0.9;
// Of that width: narrower layers are no crown yet [chosen]
inline constexpr double kBaseShare = 0.35;
// Part of the layers from below, in which bushes may be wider than the crown: one of so many
// [chosen]
inline constexpr std::size_t kLowParts = 3;
// Layers down to the next wide one that a crown may have between its own [chosen]
inline constexpr std::size_t kBaseGap = 3;
// Share of the cubes in a direction that lie within the edge of the crown [chosen]
inline constexpr double kEdgeQuantile = 0.97;
// Directions in which the reach of a whole crown is measured [tuned on `random` 1 to 6, 8, 13, 16,
// 49 to 51 and 55 to 60: docs/method/forest-experiments.md, crowns]
inline constexpr std::size_t kOutlineSectors = 24;
// The edge of a crown begins at so much of the upper quartile of these reaches [tuned likewise]
inline constexpr double kEdgeShare = 0.6;
// Cubes that show the edge of a crown in a direction, at least [chosen]
inline constexpr int kFewestEdgeCubes = 2;
// Of the directions, how many must show the edge at least. Other crowns were seen from one side,
// and their outline has 0.6 to 0.8 of their area [tuned likewise]
inline constexpr int kFewestEdgeSectors = 15;
// Times the gap to the edge of the crown that evenly spread cubes leave: edges are thin [tuned
// likewise]
inline constexpr double kThinEdge = 2.0;
// Times the median of these: what reaches farther is of another tree [tuned likewise]
inline constexpr double kStickingOut = 1.45;
// m from the surface of the stem beyond which a cube is no part of it [chosen]
inline constexpr double kBeside = 0.3;
// Cubes beside the stem, per layer of the upper half, below which it is a snag ... [tuned on random
// seeds 1, 2, 4-10, 13: 0.3 to 3]
inline constexpr double kMostBeside = 1.0;
// ... and on the stem at least: it was seen up there [tuned on the same: 2 or 3]
inline constexpr double kLeastOnStem = 3.0;
// ... and in all [chosen]
inline constexpr std::size_t kFewestOnStem = 20;
}  // namespace tree_crowns

}  // namespace understory::forest_constants
