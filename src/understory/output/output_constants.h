#pragma once

#include <cstddef>
#include <cstdint>

// The fitted and chosen numbers of the layer `output` that are no settings. One namespace for each
// file that uses them. A comment gives the unit (none: a plain number), the meaning, and in
// brackets where the number comes from:
//   chosen   by judgement, fitted to nothing
//   bound    by physics, geometry, statistics, memory or time
//   tuned    on what is named
namespace understory::output_constants {

namespace copc {  // output/copc/copc_octree.cc, copc_writer.cc
// Cells along the side of a node between which points are spaced, as a power of two [as in other
// writers of COPC: 128]
inline constexpr int kSpacingBits = 7;
// Points of a cube that is taken into memory as a whole [bound: 44 bytes each, 132 MB]
inline constexpr std::uint64_t kMostInMemory = 3'000'000;
// Points of a cube that is a leaf [chosen between 100,000 of other writers and quick pictures]
inline constexpr std::uint64_t kMostInLeaf = 50'000;
// Points of an octant that is a node; with fewer they go to the node above [chosen: a chunk costs
// some hundred bytes]
inline constexpr std::uint64_t kFewestInNode = 1'000;
// Points of nodes that are compressed together [bound: 32 MB]
inline constexpr std::size_t kPassedOn = 1'000'000;
// Steps along the side of a cell of the grid on the disk, as a power of two [chosen: 8 m of
// millimetres, some 10,000 cells for each square kilometre]
inline constexpr int kGridBits = 13;
// Points that wait in memory before they go to the disk [bound: 64 MB]
inline constexpr std::uint64_t kWaiting = 2'000'000;
// The same while a cell of the grid is divided once more [chosen]
inline constexpr std::uint64_t kWaitingFiner = 1'000'000;
// How much finer its grid is then, as a power of two [chosen]
inline constexpr int kFinerBits = 3;
// A node with fewer such cells along its side is divided with finer ones, as a power of two
// [chosen: cells on its border are read for its neighbours, too]
inline constexpr int kFewCellsBits = 2;
// Steps that the cube is longer than the cloud [bound: more than the rounding of coordinates of
// 10,000 km on the borders of ten levels, and less than is seen: a micrometre]
inline constexpr double kBorderSteps = 0.001;
}  // namespace copc

namespace matching {  // output/report/report_run.cc: distances of matched points, in sides of a
                      // cube
// Root mean square distance of the points of a good match from the means of their cubes, at least
// [tuned: 0.38 to 0.41 in ten seconds of handheld seed 7, harvester and lake seed 3]
inline constexpr double kLeastUsual = 0.32;
// The same, at most [tuned: likewise]
inline constexpr double kMostUsual = 0.46;
// The same of points that lie anywhere in their cubes [bound: sqrt(3 / 12)]
inline constexpr double kByChance = 0.5;
}  // namespace matching

}  // namespace understory::output_constants
