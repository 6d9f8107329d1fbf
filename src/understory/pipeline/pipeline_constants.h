#pragma once

#include <cstddef>
#include <cstdint>
#include <numbers>

// The fitted and chosen numbers of the layer `pipeline` that are no settings, which stand in the
// Config structs. One namespace for each file that uses them. A comment gives the unit (none: a
// plain number), the meaning, and in brackets where the number comes from:
//   chosen   by judgement, fitted to nothing
//   bound    by physics, geometry, statistics, memory or time
//   tuned    on the recordings named; where none are, on simulated ones with seeds up to 19
//   not recorded   in use for long, and nothing tells why it is this number
// or real clouds and measurements by their page.
namespace understory::pipeline_constants {

namespace input_remarks {  // pipeline/judgement/input_remarks.cc
// s without IMU at the beginning or the end that are remarked [chosen]
inline constexpr double kImuMissingS = 1.0;
}  // namespace input_remarks

namespace match_course {  // pipeline/judgement/match_course.cc
// Share of a scan's points found in the map: below, they are few [tuned on spoilt recordings,
// seeds 1 and 2, docs/method/results.md]
inline constexpr double kFewInliers = 0.25;
// Of what the run's scans usually find: below, they are few [tuned on spoilt recordings, seeds 1
// and 2, docs/method/results.md]
inline constexpr double kFewOfUsual = 0.5;
// Of the finest cell's edge: mean distance of found points. Chance gives 0.5 (a uniform point in
// a cube, from its middle); good maps of forests, streets and yards have 0.32 to 0.46 [bound:
// geometry, and real clouds]
inline constexpr double kByChance = 0.49;
// ns: windows in which matches are judged [chosen]
inline constexpr std::int64_t kWindow = 2'000'000'000;
// Windows at the start of a run that are not judged: the map grows [chosen]
inline constexpr std::int64_t kFirstWindow = 5;
}  // namespace match_course

namespace path_evidence {  // pipeline/judgement/path_evidence.cc
// s: below, a difference of stamps tells nothing of a speed [bound: rounding of stamps]
inline constexpr double kShortestStepS = 1e-3;
// Quantile of speeds and accelerations that is judged [chosen]
inline constexpr double kUsual = 0.99;
// Quantile of accelerations that tells a path that shakes [tuned: lake seed 91 without IMU]
inline constexpr double kOften = 0.95;
// ns before and after a jump that tell how fast the path was [chosen]
inline constexpr std::int64_t kJumpBase = 500'000'000;
// ns between impossible steps of one jump at most [chosen]
inline constexpr std::int64_t kJumpGap = 500'000'000;
}  // namespace path_evidence

namespace run_judgement {  // pipeline/judgement/run_judgement.cc
// Standard errors that are no chance, even where pairs of views that overlap say the same
// [chosen]
inline constexpr double kSureErrors = 5.0;
// m at which a turn counts as a shift [chosen]
inline constexpr double kRangeM = 10.0;
// Of JudgementConfig::max_imu_scatter_m_s2, where matches contradicted an IMU that was right [tuned
// on swing: 0.76 m/s^2 at 21 cm, good runs at most 0.41]
inline constexpr double kShareOfScatterWhenCleared = 0.5;
// Share of the scans whose points have times in no order [chosen: no lidar gives one]
inline constexpr double kMostMixedTimes = 0.05;
// Standard deviations that the ratio of motions within and between scans has to be off [tuned:
// random 4, 20 s, has 0.34 +- 0.14, and its path is right to 2 mm. Times that run backwards have
// 0.24 +- 0.10 in 24 s]
inline constexpr double kScanMotionSds = 1.0;
// and how far that may widen the limits [bound: wrong times make probes differ, too]
inline constexpr double kMostScanMotionMargin = 0.1;
// degrees that a map leans at most, with kLargeBiasMPerS2: 1.7 m over 50 m [chosen]
inline constexpr double kMostTiltDeg = 2.0;
// m/s^2: an accelerometer that is off by more is not calibrated; good ones have 0.1 [data sheets]
inline constexpr double kLargeBiasMPerS2 = 0.3;
}  // namespace run_judgement

namespace stand_notes {  // pipeline/judgement/stand_notes.cc
// Share of the area with points where coverage is thin: less is not told [chosen]
inline constexpr double kThinShare = 0.05;
}  // namespace stand_notes

namespace evidence_gathering {  // pipeline/judgement/evidence_gathering.cc
// s without samples that are told [chosen]
inline constexpr double kNoticeableS = 0.1;
}  // namespace evidence_gathering

namespace sensor_traits {  // pipeline/mapping/sensor_traits.cc
// Scans that tell what the sensors are [chosen]
inline constexpr std::size_t kScans = 10;
// Returns; a scan with fewer tells nothing of the lidar [chosen]
inline constexpr std::size_t kEmptyScan = 1'000;
// Scans that are looked at, empty ones included [bound: time]
inline constexpr std::size_t kMostScans = 100;
// Events held in memory: 40 minutes of an IMU alone [bound: memory]
inline constexpr std::size_t kMostEvents = 500'000;
}  // namespace sensor_traits

namespace adaptation {  // pipeline/mapping/adaptation.cc
// m: keyframe.distance_m of a sparse lidar [chosen]
inline constexpr double kSparseKeyframeM = 0.3;
// keyframe.below_found_share of a sparse lidar [chosen: in good runs no scan finds less than 0.8 of
// what is usual, docs/method/odometry.md]
inline constexpr double kSparseFoundShare = 0.75;
// registration.few_found_residual of a sparse lidar [tuned: slow turns over even ground have up to
// 1.5, two recordings joined 1.9 to 3]
inline constexpr double kSparseFewFound = 1.5;
// m between scans of the finished map [chosen]
inline constexpr double kSparseCloudM = 0.1;
// m (37): map.far_cloud_distance_m of a full inventory [tuned on `random` 1 to 16 and 49 to 51]
inline constexpr double kFarCloudM = 0.25;
// Registration.min_inlier_ratio: few of the map's small cells have enough points at first
// [chosen]
inline constexpr double kSparseInlierRatio = 0.05;
}  // namespace adaptation

namespace event_loop {  // pipeline/mapping/event_loop.cc
// Times that a recording is begun anew with a refined IMU at most [bound: time; the second time
// differs from the first by what the fit is not linear in]
inline constexpr int kMostRefinements = 3;
}  // namespace event_loop

namespace cloud_tiles {  // pipeline/inventory/cloud_tiles.cc, streamed_cloud.cc
// m: edge of the cells on disk: what lies around a tile is read by them [bound: time]
inline constexpr double kCell = 10.0;
// Cells across a cloud, at most: larger clouds have larger cells [bound: time]
inline constexpr double kMostCellsAcross = 128.0;
// Cells a side of a tile, at most [bound: time]
inline constexpr int kMostCellsOfTile = 100;
// m around a tile whose points are held with it [bound: the reach of stems and crowns]
inline constexpr double kAround = 20.0;
// m: tiles are not made smaller to hold two at once [chosen]
inline constexpr double kSmallestSideBySide = 40.0;
// Points of a cell that are written at once [bound: time]
inline constexpr std::size_t kChunk = 8192;
// Points that wait to be written, at most [bound: memory]
inline constexpr std::uint64_t kMostBuffered = 4'000'000;
// Points that are handed over at once [bound: memory]
inline constexpr std::size_t kBlock = 65'536;
// Bytes that a tile takes for each point in and around it [measured on simulated clouds]
inline constexpr double kBytesPerPoint = 40.0;
// Bytes that an inventory takes beside its tiles [measured on simulated clouds]
inline constexpr double kBaseBytes = 300e6;
// Bytes for each point where the whole cloud is held [measured on simulated clouds]
inline constexpr double kBytesPerPointWhole = 100.0;
// Bytes on disk for each point: itself, what is thinned, map.laz [measured on simulated clouds]
inline constexpr double kDiskBytesPerPoint = 45.0;
// The same of map.copc.laz and of the points that wait for it [32 and measured]
inline constexpr double kCopcDiskBytesPerPoint = 40.0;
// Points whose shape is looked at [as kMostPoints of cloud_shape]
inline constexpr std::uint64_t kSample = 400'000;
}  // namespace cloud_tiles

namespace tiled_map {  // pipeline/mapping/tiled_map.cc
// m beside its tile at which a point may lie, as places are moved to the map's grid [bound: its
// step]
inline constexpr double kBesideTileM = 0.01;
// Bytes that an inventory of a map on disk takes for each of its points [measured on simulated
// runs]
inline constexpr double kBytesPerPointWhole = 30.0;
// The same of a tile, for each point in and around it [measured on simulated runs]
inline constexpr double kBytesPerPoint = 30.0;
}  // namespace tiled_map

namespace memory_plan {  // pipeline/mapping/dense/memory_plan.cc
// Bytes that a run takes beside what follows [measured on simulated runs]
inline constexpr double kProgramBytes = 130e6;
// Bytes for each return of a scan: the scans that wait, are worked on and are looked back at for a
// loop [measured on simulated runs]
inline constexpr double kBytesPerScanPoint = 1000.0;
// Bytes for each return of a scan of a keyframe whose points are in memory [bound: 12 a point]
inline constexpr double kBytesPerKeyframePoint = 12.0;
// Returns of a scan of a lidar that nothing is known of [bound: 128 rings of 1,024 columns]
inline constexpr std::uint64_t kPointsOfUnknown = 131'072;
// Keyframes in memory, at least [chosen]
inline constexpr int kFewestKeyframes = 30;
// Share of what is left for keyframes, at most; the rest is for the local map [chosen]
inline constexpr double kShareOfKeyframes = 0.3;
// Bytes of the smallest local map [measured: 45 m around an OS0-128 in a stand]
inline constexpr double kLeastLocalMapBytes = 60e6;
// Share of what is left for making the tiles of the finished map [chosen]
inline constexpr double kShareOfTiles = 0.4;
// Bytes for that, at most: more helps no more [bound: time]
inline constexpr double kMostTileBytes = 200e6;
// Bytes that an inventory takes beside its points [measured on simulated runs]
inline constexpr double kFinishBytes = 40e6;
// Bytes for map.copc.laz [docs/reference/outputs.md]
inline constexpr double kCopcBytes = 300e6;
// Share of the limit from which on caches are emptied [chosen]
inline constexpr double kShortShare = 0.85;
}  // namespace memory_plan

namespace stand_cloud {  // pipeline/inventory/stand_cloud.cc
// m by which places may be rounded: a tenth of a thin stem [chosen]
inline constexpr double kCoarsestStepM = 0.01;
// Times that step, which a file holds in binary, or in feet [bound: rounding]
inline constexpr double kRounding = 1.01;
// Share by which a unit of heights is another one than that of the plane: international and US
// feet differ by 2e-6 [chosen]
inline constexpr double kSameUnit = 1e-4;
}  // namespace stand_cloud

namespace labelled_cloud {  // pipeline/inventory/labelled_cloud.cc
// m beside a tile: cubes of crowns that begin in it reach so far [bound: their edge]
inline constexpr double kBesideTile = 0.25;
}  // namespace labelled_cloud

namespace cloud_inventory {  // pipeline/inventory/cloud_inventory.cc
// m above the ground that a tenth of the canopy model reaches: trees, whose stems must be listed
// [chosen]
inline constexpr double kTallWithoutStemsM = 6.0;
// m: diameter of a tree of such a canopy at least [chosen: forest_constants::kThinnestBasic]
inline constexpr double kThinnestGrownM = 0.05;
// Share of the cells of the canopy model that are lower [chosen]
inline constexpr double kCanopyQuantile = 0.9;
// m: lower stands may be slender, and are not tall for feet [as kTallForMetres of cloud_shape]
inline constexpr double kTallM = 42.0;
// Height over diameter: no tall stand is more slender; real ones have 40 to 100, in feet of height
// and metres of diameter 3.3 times as much [bound: forests]
inline constexpr double kMostSlender = 150.0;
// m: a thinner cloud without a stem may be a cut [chosen: stems need 1.5 m at least]
inline constexpr double kThinCutM = 1.0;
// Trees with both figures at least [chosen]
inline constexpr std::size_t kLeastTrees = 3;
}  // namespace cloud_inventory

namespace lidar_view {  // pipeline/inventory/lidar_view.cc
// Clouds that a view is learnt from [chosen]
inline constexpr std::size_t kClouds = 60;
// m from which a crown still gives enough returns [chosen]
inline constexpr double kReach = 60.0;
// m between poses: what is seen hardly changes sooner [chosen]
inline constexpr double kStep = 1.0;
// Slope by which a point lies lower than another whatever their rounding [bound: doubles]
inline constexpr double kSureSlope = 1e-9;
// Points after which the slope that all sectors have is looked for again [chosen: speed alone]
inline constexpr std::size_t kPointsPerLook = 512;
}  // namespace lidar_view

namespace run_tops {  // pipeline/georeferencing/methods/run_tops.cc
// m from a tree to one whose crown may hide its top [chosen: the radius of most crowns]
inline constexpr double kOvertopReachM = 2.5;
// m that such a one is higher by [chosen: several times what heights err by]
inline constexpr double kClearlyHigherM = 2.0;
}  // namespace run_tops

namespace georeferencing {  // pipeline/georeferencing/methods/place_by_*.cc
// degrees: with a less certain heading a place 50 m from the path's middle is over 4 m off
// [chosen]
inline constexpr double kMostHeadingSdDeg = 5.0;
// m: a carrier that stands and is placed by headings counts as a path of that extent, where fixes
// are compared with it [chosen: receivers under trees err by less than 0.4 of it]
inline constexpr double kStandingReachM = 25.0;
// Share of the pairs of fixes and path that may be far off the others. Beyond it all pairs tell
// whether the fixes are of this run [chosen: half is what a robust fit can stand]
inline constexpr double kMostLeftOut = 0.25;
// m from the body to an antenna [bound: carriers]
inline constexpr double kLongestArmM = 10.0;
// m around the path whose ground is fitted [chosen]
inline constexpr double kReachM = 30.0;
// Trees are searched around the place by the fixes: expected errors [chosen]
inline constexpr double kSearchedSigmas = 4.0;
// and m beyond them [chosen: a few trees apart]
inline constexpr double kSearchedAtLeastM = 20.0;
// Of fixes and trees together: chi squared beyond which they contradict each other [tuned: the GNSS
// presets of docs/method/georeference.md, seeds 1 to 19, are off by up to 9.5 standard deviations]
inline constexpr double kMostDisagreement = 100.0;
// m: spread of the ground about a terrain model after the fit, at most. A constant is taken off
// [chosen: laser models err by 0.3 m, crowns by their own height; 1.4 m of coarse national models
// tell no tilt of a plot]
inline constexpr double kMostTerrainSpreadM = 1.0;
// m between the heights of a terrain model and of fixes: said from here on [chosen: fixes under
// trees err by less in the mean of a path]
inline constexpr double kHeightsDifferM = 8.0;
// m: no geoid lies farther from the ellipsoid [bound: EGM2008 spans -106 to 86, and fixes err]
inline constexpr double kMostGeoidM = 125.0;
}  // namespace georeferencing

namespace correction_figures {  // pipeline/correction/correction_figures.cc
// Pairs drawn for P0 figure 9 [chosen]
inline constexpr int kPairs = 4000;
// views along each side of P1 figure 5 [chosen]
inline constexpr int kMatrix = 220;
// m: stems that far apart are outliers, P1 figure 5 [chosen]
inline constexpr double kSame = 0.5;
// m: width of the rings of P1 figure 8 [chosen]
inline constexpr double kRing = 5.0;
// Rings of P1 figure 8 [chosen]
inline constexpr int kRings = 8;
}  // namespace correction_figures

namespace head_cut_log {  // pipeline/correction/head_cut_log.cc
// Cuts of a head from which on most of them must lie at trees [chosen: of fewer, one or two may be
// of trees that the lidar never listed]
inline constexpr std::size_t kFewestCuts = 4;
}  // namespace head_cut_log

namespace imu_calibration {  // pipeline/calibration/lidar_imu_run.cc, lidar_clocks_run.cc
// Times the covariance where the scans were deskewed without the IMU [tuned: handheld by VLP-16,
// 60 s, seeds 1, 2, 102, 120: squared errors over the variance were 4.3]
inline constexpr double kScansAloneAreWorse = 4.3;
// Share of the first path that the second one has at least to count [chosen]
inline constexpr double kLeastShareAgain = 0.8;
// s: standard deviation of a clock that is known well enough. A machine that turns with half a
// radian a second puts a point 20 m away 1 cm off by twice of it [chosen]
inline constexpr double kSureSdS = 0.001;
// rad: that of the rotation of an IMU on a lidar that is known well enough [chosen: three times the
// goal of a minute's walk, docs/method/calibration.md]
inline constexpr double kSureTurnSd = 0.3 * std::numbers::pi / 180.0;
// m: that of its place, along each axis [chosen: two and a half times that goal]
inline constexpr double kSurePlaceSdM = 0.05;
}  // namespace imu_calibration

namespace stand_plots {  // pipeline/inventory/stand_plots.cc
// Share of a plot that was seen: with more it counts as whole, as cells at its border are uncertain
// [chosen]
inline constexpr double kWhole = 0.99;
// Grid cells at most: more are a mistake of the unit [chosen]
inline constexpr double kMostGridCells = 200'000.0;
}  // namespace stand_plots

}  // namespace understory::pipeline_constants
