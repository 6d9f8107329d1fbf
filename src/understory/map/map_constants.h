#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>

// The fitted and chosen numbers of the layer `map` that are no settings, which stand in the Config
// structs. One namespace for each file that uses them. A comment gives the unit (none: a plain
// number), the meaning, and in brackets where the number comes from:
//   chosen   by judgement, fitted to nothing
//   bound    by physics, geometry, statistics, memory or time
//   tuned    on the recordings named; where none are, on simulated ones with seeds up to 19
//   probed   what a fifth less and a quarter more change, docs/method/constants.md
// or real clouds and measurements by their page.
namespace understory::map_constants {

namespace carrier_region {  // map/carrier_region.cc
// m: edge of the voxels around the lidar, as of CarrierReturns [chosen]
inline constexpr double kVoxelM = 0.2;
// m: edge of the world's voxels in which points from elsewhere are looked for; those that touch
// count, too [chosen: wider than the errors of a map and of the motion within a scan]
inline constexpr double kWorldVoxelM = 0.15;
// m between the places of two clouds: what stands in the world leaves its voxel [chosen]
inline constexpr double kApartM = 0.5;
// clouds of a stretch at least [chosen]
inline constexpr std::size_t kFewestClouds = 5;
// m between the two farthest places of a stretch at least: ground around one is seen from the other
// from beyond the usual reach [chosen: the reach and a metre]
inline constexpr double kLeastWayM = 4.0;
// Stretches of a run that are looked at [bound: time]
inline constexpr std::size_t kStretches = 3;
// Clouds of each [bound: time]
inline constexpr std::size_t kCloudsOfStretch = 20;
// Share of the clouds that show a voxel which touches one that stays [chosen]
inline constexpr double kShareBeside = 0.15;
// Share of a voxel's points that others show from elsewhere: with more it is the world's [chosen;
// tuusniemi1 seed 5: under 0.1 on its posts, over 0.9 on the ground]
inline constexpr double kElsewhere = 0.5;
// World voxels of the carrier's points in a cloud at least, on average: fewer are single flakes or
// twigs [chosen: a post of 1 m has seven]
inline constexpr std::uint64_t kFewestShown = 5;
}  // namespace carrier_region

namespace felled_trees {  // map/felled_trees.cc
// m in the plane within which a sight is of a tree [chosen]
inline constexpr double kSameTreeM = 0.6;
// m between the places of two views from which a tree looks alike [tuned on Wild-Places V-03: of
// misses from elsewhere the most are of trees that stand]
inline constexpr double kSamePlaceM = 3.0;
}  // namespace felled_trees

namespace upright_views {  // map/upright_views.cc
// z of up in the body below which it is turned upright: cosine of 20 degrees [chosen: no machine
// works for long on a slope as steep]
inline constexpr double kUpright = 0.94;
// z of up in the body below which the body hangs over: cosine of 120 degrees [chosen: as in
// odometry/stems/stem_levelling.cc]
inline constexpr double kFarOver = -0.5;
}  // namespace upright_views

namespace foot_heights {  // map/foot_heights.cc
// m in the plane within which feet show the height of the body above the ground [chosen: on a slope
// feet before and behind a body differ by less than a metre]
inline constexpr double kNearM = 5.0;
// feet that a view must have there [chosen]
inline constexpr std::size_t kFewestFeet = 3;
// views with so many; fewer tell nothing [chosen]
inline constexpr std::size_t kFewestViews = 20;
// Share of the views at either end that is left out [chosen]
inline constexpr double kTail = 0.05;
// m: a scanner in the hand or on a machine is not carried over a wider range [chosen]
inline constexpr double kWidestRangeM = 2.0;
}  // namespace foot_heights

namespace near_columns {  // map/clouds/near_columns.cc
// m: edge of a column [chosen: a stem and what hides it]
inline constexpr double kColumnM = 0.5;
// One point of so many is looked at [bound: time]
inline constexpr std::size_t kEachOf = 4;
// of those in a column, for it to be seen well [chosen: 20 points]
inline constexpr std::uint32_t kFewestPoints = 5;
}  // namespace near_columns

namespace stem_map {  // map/stem_map.cc
// views that should have seen both of two trees; with fewer nothing is told [chosen]
inline constexpr double kEnoughViews = 3.0;
// Of these: seen together less often, two trees are one [tuned on lieksa2: the list falls from
// 2,513 to 1,338 trees at the same recall]
inline constexpr double kFew = 0.1;
// Share of the views in whose sector a listed tree lies that have to show it
// [docs/method/sparse.md: an eighth]
inline constexpr double kListedPresence = 0.12;
// m: listed trees that are nearer and never seen together are one [probed: no byte]
inline constexpr double kListedDuplicate = 1.2;
// Standard deviation of a diameter. Sights that what sights state of themselves counts as, beside
// their scatter ... [tuned: benchmarks/stated_errors.py, on
// recordings of docs/method/sparse-experiments.md, how sure diameters are]
inline constexpr double kStatedSights = 4.0;
// ... of the diameter, as a stem is not round ... [tuned likewise]
inline constexpr double kOval = 0.015;
// ... and of what wide beams add to the width of a stem [tuned likewise]
inline constexpr double kBeamShare = 0.85;
}  // namespace stem_map

namespace loop_closer {  // map/loop_closer.cc
// Between two questions whether to go on waiting for a search [bound: a user's patience]
inline constexpr std::chrono::milliseconds kPollInterval{50};
}  // namespace loop_closer

namespace searched_map {  // map/searched_map.cc
// Factor of the covariance of a guess that a match has replaced: with it the guess pulls on no pose
// by a micrometre [bound: loops have centimetres, guesses tens of metres]
inline constexpr double kGuessIsWorthless = 1e4;
}  // namespace searched_map

namespace local_map {  // map/local_map.cc
// Factor by which the radius becomes smaller where the map takes too much [chosen]
inline constexpr double kSmaller = 0.9;
// Share of what it may take below which the radius becomes larger again [bound: a radius larger by
// 1 / kSmaller takes 1.37 times as much at most where the height of the stand counts, too]
inline constexpr double kRoomToGrow = 0.7;
// m: a smaller radius holds less than a scan shows of the stems around [chosen]
inline constexpr double kLeastRadiusM = 20.0;
}  // namespace local_map

namespace returning_keyframes {  // map/keyframes/returning_keyframes.cc
// Share of the radius within which a keyframe comes back [chosen: what is nearer than the rim stays
// while the carrier comes nearer still]
inline constexpr double kNear = 0.5;
// Keyframes that come back beside a new one, at most [bound: time of a scan; there are as many on
// the old way as on the new one]
inline constexpr std::size_t kMostAtOnce = 3;
}  // namespace returning_keyframes

namespace keyframe_map {  // map/keyframes/keyframe_map.cc
// Keyframes whose points stay in memory, about 60 MB [bound: memory]
inline constexpr std::size_t kCachedKeyframes = 150;
}  // namespace keyframe_map

}  // namespace understory::map_constants
