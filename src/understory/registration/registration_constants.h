#pragma once

#include <cstddef>
#include <cstdint>

// The fitted and chosen numbers of the layer `registration` that are no settings, which stand in
// the Config structs. One namespace for each file that uses them. A comment gives the unit (none:
// a plain number), the meaning, and in brackets where the number comes from:
//   chosen   by judgement, fitted to nothing
//   bound    by physics, geometry, statistics, memory or time
//   tuned    on the recordings named; where none are, on simulated ones with seeds up to 19
//   not recorded   in use for long, and nothing tells why it is this number
// or real clouds and measurements by their page.
namespace understory::registration_constants {

namespace ndt_cell {  // registration/ndt/ndt_cell.cc
// Middle over largest variance: below, a line. Beyond what noise makes of ratios: a short piece
// of a ring is as wide as the noise [chosen]
inline constexpr double kLineRatio = 0.05;
// Smallest over middle variance: below, a surface [chosen]
inline constexpr double kPlaneRatio = 0.15;
// Of a line against z: steeper ones are stems, not rings; 45 degrees [chosen]
inline constexpr double kPoleCosine = 0.7;
// Length of the mean of unit rays: longer, a cell was seen from one side only [chosen; measured
// on harvester seeds 3 and 11, docs/method/registration.md]
inline constexpr double kOneSide = 0.9;
// Sine of the angle between a surface and the rays: smaller, the rays lie in it [tuned on swing and
// hover 1 to 19 and 51 to 60, 0.1 to 0.2 tried, docs/method/odometry.md]
inline constexpr double kGrazing = 0.15;
// Variance of a surface's second axis over that of a full cell. Below it the surface is a strip,
// and its surroundings tell its slope across [chosen]
inline constexpr double kStripShare = 0.5;
// Squared floors of sigma added to the limit of a line [chosen]
inline constexpr double kLineNoise = 1.0;
// Squared floors of sigma added to the limit of a surface [chosen]
inline constexpr double kPlaneNoise = 0.25;
}  // namespace ndt_cell

namespace ndt {  // registration/ndt/ndt.cc
// points that the wide steps take: they only look for where the last ones begin [chosen; measured
// on handheld and harvester seed 4, docs/method/registration.md]
inline constexpr std::size_t kEnoughForWideSteps = 8000;
// Every so many points of a scan that has more [as kEnoughForWideSteps]
inline constexpr std::size_t kWideEvery = 4;
}  // namespace ndt

namespace wide_steps {  // registration/wide_steps.h
// Points that steps from far take, and every so many of a scan that has more [as
// ndt::kEnoughForWideSteps]
inline constexpr std::size_t kEnough = 8000;
// The next of these [as kEnough]
inline constexpr std::size_t kEvery = 4;
// m, rad: a shorter step ends them [as NdtConfig::wide_until_m; the same at 20 m]
inline constexpr double kTranslation = 0.02;
// The next of these [chosen]
inline constexpr double kRotation = 0.001;
}  // namespace wide_steps

namespace ndt_matcher {  // registration/ndt/ndt_matcher.cc
// points that shape cells twice as large or larger [as kEnoughForWideSteps]
inline constexpr std::size_t kEnoughForCoarse = 20000;
// Every so many points of a cloud that has more [as kEnoughForWideSteps]
inline constexpr std::size_t kCoarseEvery = 4;
// Registration.ndt.min_points of a sparse lidar [chosen]
inline constexpr int kSparseMinPoints = 4;
// Registration.ndt.volume_weight of a sparse lidar: sparse scans leave few surfaces, so all cells
// count [chosen]
inline constexpr double kSparseVolumeWeight = 1.0;
}  // namespace ndt_matcher

namespace icp {  // registration/icp/icp.cc
// Neighbours of a normal at most [bound: time]
inline constexpr std::size_t kMaxNeighbours = 100;
}  // namespace icp

namespace surface {  // registration/icp/surface.cc
// points of a surface at least [bound: a plane has three parameters]
inline constexpr std::size_t kFewestPoints = 4;
// Neighbours of a surface at most [bound: time]
inline constexpr std::size_t kMaxNeighbours = 100;
// Middle over largest variance: below, a line [chosen, as in NDT]
inline constexpr double kLineRatio = 0.05;
// Of a line against z: steeper ones are stems, not rings; 45 degrees [chosen, as in NDT]
inline constexpr double kPoleCosine = 0.7;
}  // namespace surface

namespace gaussian_voxels {  // registration/gaussian/gaussian_voxels.cc
// Middle over largest variance: below, a line [chosen, as in NDT]
inline constexpr double kLineRatio = 0.05;
// Smallest over middle variance: below, a surface [chosen, as in NDT]
inline constexpr double kPlaneRatio = 0.15;
// m: standard deviation of a point along its surface, at least [chosen, as in GICP]
inline constexpr double kAlong = 1.0;
}  // namespace gaussian_voxels

namespace robust_loss {  // registration/robust_loss.cc
// Standard deviations of the scale of Huber's loss: 95 % efficient where errors are normal, by the
// efficiency (E psi')^2 / E psi^2 [Huber 1981]
inline constexpr double kHuberWidth = 1.345;
// The same of Welsch's loss [Dennis and Welsch 1978]
inline constexpr double kWelschWidth = 2.985;
// The same of Geman and McClure's loss [bound: the efficiency, worked out]
inline constexpr double kGemanMcClureWidth = 3.79;
// Of FRMSD in three dimensions [Phillips et al. 2007, section 3]
inline constexpr double kFractionPower = 1.3;
// Share of the residuals that counts at least [chosen]
inline constexpr double kLeastShare = 0.3;
// An estimated scale is at least this share of the setting [chosen]
inline constexpr double kLeastScale = 0.01;
}  // namespace robust_loss

namespace ring_features {  // registration/loam/ring_features.cc, ring_clusters.cc
// Directions in which the slope from ring to ring is found; 0.2 degrees [chosen: about a column of
// an Ouster with 2048 or a VLP-16 with 1800]
inline constexpr std::size_t kAzimuthBins = 1800;
// Columns to each side in which the neighbour of a point is looked for [chosen: lidars with 1024
// columns leave every second one empty]
inline constexpr std::size_t kColumnGap = 3;
// m: smoothness divides by the range [bound: no lidar measures nearer]
inline constexpr double kLeastRange = 0.1;
// A cluster with fewer points than are asked for counts with so many of them ... [source: the
// program of the authors of LeGO-LOAM, 2018]
inline constexpr std::size_t kUprightPoints = 5;
// ... on so many rings: a post, a far stem [source: as above]
inline constexpr std::size_t kUprightRings = 3;
}  // namespace ring_features

namespace solve {  // registration/solve.cc
// A step is taken back and halved if it ends on a rise steeper than this share of the fall at its
// start [chosen]
inline constexpr double kMostOvershoot = 0.9;
}  // namespace solve

namespace range_offset {  // registration/range_offset/range_offset.cc
// m: noise of a patch's mean along its normal; sets what the guess weighs against surfaces
// [chosen]
inline constexpr double kPatchNoise = 0.03;
// m: nothing is known of the offset; keeps the equations regular where no surface tells it
// [bound: none]
inline constexpr double kOffsetSd = 10.0;
// Last scales: width of the kernel at first [chosen]
inline constexpr double kWidest = 10.0;
// m of the offset in one step [chosen]
inline constexpr double kLongestStep = 0.5;
}  // namespace range_offset

namespace sparse_icp {  // registration/stems/sparse_icp.cc
// degrees of freedom of Student's t: heavy tails for stems that are not the same [chosen]
inline constexpr double kFreedom = 3.0;
// Weight of heights against the plane where their errors are known: a foot that is a metre too
// high still finds its stem [chosen]
inline constexpr double kUnsure = 0.05;
}  // namespace sparse_icp

namespace yaw_vote {  // registration/stems/yaw_vote.cc
// Steps of yaw: peaks of the vote that are nearer are one, if ... [not recorded]
inline constexpr double kSameYawSteps = 2.5;
// ... cells of the shift are, too [not recorded]
inline constexpr double kSameCells = 3.0;
}  // namespace yaw_vote

namespace go_icp {  // registration/stems/go_icp.cc
// L0: pairs whose heights tell the height of a match are nearer [not recorded]
inline constexpr double kHeightPairL0 = 0.15;
}  // namespace go_icp

}  // namespace understory::registration_constants
