#pragma once

#include <cstddef>
#include <cstdint>

// The fitted and chosen numbers of the layer `preprocess` that are no settings, which stand in the
// Config structs. One namespace for each file that uses them. A comment gives the unit (none: a
// plain number), the meaning, and in brackets where the number comes from:
//   chosen   by judgement, fitted to nothing
//   bound    by physics, geometry, statistics, memory or time
//   tuned    on the recordings named; where none are, on simulated ones with seeds up to 19
//   probed   what a fifth less and a quarter more change, docs/method/constants.md
//   not recorded   in use for long, and nothing tells why it is this number
// or real clouds and measurements by their page.
namespace understory::preprocess_constants {

namespace carried_returns {  // preprocess/carried_returns.cc
// m: edge of the voxels beside the lidar [chosen]
inline constexpr double kVoxelM = 0.2;
// Scans over which the share of a voxel is a mean [chosen: 3 s]
inline constexpr std::uint32_t kScans = 30;
// Scans after which it is asked again whether a voxel lies on a level surface [bound: time]
inline constexpr std::uint32_t kJudgeEvery = 10;
// Points of a voxel that are summed up; at the next question its sums are halved [chosen]
inline constexpr float kFullVoxel = 1000.0F;
// Smallest over middle variance: below, a surface [chosen, as in NDT]
inline constexpr double kFlat = 0.15;
// m: standard deviation across a surface that is noise [chosen, half of NDT's floor]
inline constexpr double kNoiseM = 0.015;
// m: standard deviation along the narrow side of a surface at least: narrower, it is a bar [chosen]
inline constexpr double kWidthM = 0.08;
// Cosine between the normal of a level surface and up, at least; 25 degrees [chosen]
inline constexpr double kLevel = 0.9;
// m: how far below a level surface another thing lies at least that makes it no ground [chosen:
// rough ground is less high]
inline constexpr double kDropM = 0.35;
// Squared sine of the angle at which that lies below at least; 30 degrees [chosen]
inline constexpr double kSteep = 0.25;
}  // namespace carried_returns

namespace event_orderer {  // preprocess/streams/event_orderer.cc
// Messages of a stream while no other has any: it cannot be compared then [probed: no byte]
inline constexpr std::size_t kMostSuspects = 1000;
// Scans of the lidar while no other stream has a message: the same [probed: no byte]
inline constexpr std::size_t kMostSuspectScans = 32;
// Smallest jumps: a longer step tells nothing of the rate of a stream [probed: no byte]
inline constexpr std::int64_t kStartFactor = 5;
// Messages that wait for a verdict on their clock at most [bound: memory]
inline constexpr std::size_t kMostHeld = 20'000;
// Scans after which an IMU without a message is silent [probed: no byte]
inline constexpr std::uint32_t kSilentScans = 10;
}  // namespace event_orderer

namespace isolated_points {  // preprocess/isolated_points.cc
// Share of the points that stand alone: beyond it the points are in no order [not recorded]
inline constexpr double kMostAlone = 0.5;
}  // namespace isolated_points

namespace point_order {  // preprocess/point_order.cc
// Points of a scan that are looked at [bound: time]
inline constexpr std::size_t kMostPoints = 2'000;
// Points of a scan at least, or nothing is told [chosen]
inline constexpr std::size_t kLeastPoints = 300;
// Different times among them at least [chosen: sensors that give one time to many points]
inline constexpr std::size_t kLeastTimes = 50;
// Points after one in time that are compared with it [chosen: beams of one moment]
inline constexpr std::size_t kFollowing = 4;
// Median angle over that of a mixed order, below which there is an order; lidars have 0.1 and less,
// mixed times 0.9 to 1.1 [simulated]
inline constexpr double kOrderedShare = 0.5;
}  // namespace point_order

namespace weather_filter {  // preprocess/weather_filter.cc
// Share of the returns that are darker than the bright ones [tuned: skidoo, lake, tuusniemi1,
// harvester, seed 3: snow and bare ground have one scale then]
inline constexpr double kBrightShare = 0.9;
// Added to brightness: a black return needs some distance too [tuned: as above]
inline constexpr float kDarkest = 0.02F;
// Range at which `apart` holds as it stands, metres [chosen: in the middle of what is seen]
inline constexpr float kUsualRangeM = 10.0F;
// Power of the range over that one by which less is needed farther away. False ranges come from
// anywhere, what is there is mostly near [tuned: skidoo, lake, tuusniemi1, harvester, seeds 3, 5,
// 7, 9, 151, 152]
inline constexpr float kByRange = 0.18F;
// Share of the range within which a return that stands alone has nothing near, over the reach
// [chosen]
inline constexpr float kAlone = 0.8F;
// Share of the returns around one that stand alone, from which on there is weather [tuned: as
// above]
inline constexpr double kLoneInWeather = 0.039;
// Added to that share: some stand alone in clear weather too [tuned: as above]
inline constexpr double kLoneAnywhere = 0.008;
// Power of that share by which a return must be farther from others where there is less weather
// [tuned: as above]
inline constexpr double kByLoneShare = 0.63;
// Share of the returns around one that stand alone, from which on the weather is thick. Good
// returns between flakes have few others near them, and flakes stand out there [tuned: as above]
inline constexpr double kThickFrom = 0.05;
// The share at which it is as thick as can be [tuned: as above]
inline constexpr double kThickest = 0.29;
// How many times as far from others a return must be in the thickest weather [tuned: as above]
inline constexpr double kInThickest = 2.05;
// How many times as far from others it must be where a neighbour on the ring goes on with it
// [tuned: as above]
inline constexpr float kContinues = 1.32F;
// Rings on either side that are around a return [tuned: as above]
inline constexpr int kRingsAround = 2;
// Columns of a scan before and after it that are around a return, of 180 [tuned: as above]
inline constexpr int kColumnsAround = 10;
// How far the lidar may have moved between a scan and those before it, metres. A return that is
// nearer than some times that is then looked for in vain [chosen: 5 m/s at 10 Hz]
inline constexpr double kMovedM = 0.5;
// Returns that a thread judges at a time [bound: time]
inline constexpr std::size_t kGrain = 512;
}  // namespace weather_filter

}  // namespace understory::preprocess_constants
