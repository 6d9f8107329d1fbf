#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

// The fitted and chosen numbers of the layer `forest` but for its stems (stem_constants.h) that are
// no settings, which stand in the Config structs. One namespace for each file that uses them. A
// comment gives the unit (none: a plain number), the meaning, and in brackets where the number
// comes from:
//   chosen   by judgement, fitted to nothing
//   bound    by physics, geometry, statistics, memory or time
//   tuned    on the recordings named; where none are, on simulated ones with seeds up to 19
//   not recorded   in use for long, and nothing tells why it is this number
// or real clouds and measurements by their page.
namespace understory::forest_constants {

namespace obstacles {  // forest/obstacles.cc
// cells of the free height, or they are made wider [bound: 160 MB]
inline constexpr double kMostCells = 4e7;
}  // namespace obstacles

namespace cloud_shape {  // forest/cloud_shape.cc
// points of a cloud that are looked at [bound: time]
inline constexpr std::size_t kMostPoints = 400'000;
// cells along the longer side [chosen]
inline constexpr double kCellsAcross = 24.0;
// points a cell on average, or cells become larger [chosen]
inline constexpr double kPointsPerCell = 64.0;
// points in a cell whose lowest point counts [chosen]
inline constexpr std::size_t kLeastPoints = 16;
// steps between cells; with fewer nothing is told of the ground [chosen]
inline constexpr std::size_t kLeastSteps = 100;
// Roughness, in cells: another axis that is smoother may be up [real clouds,
// docs/method/forest.md]
inline constexpr double kSmooth = 0.2;
// Roughness, in cells: z above it is not up [real clouds, docs/method/forest.md]
inline constexpr double kRough = 0.3;
// Times smoother another axis has to be than z [real clouds, docs/method/forest.md]
inline constexpr double kClearly = 1.8;
// Roughness, in cells: an axis that is smoother may be up where z is far rougher [real clouds: one
// has 0.22 where the grid falls badly]
inline constexpr double kSmoothBeside = 0.28;
// Times smoother such an axis has to be than z [real clouds: 4.3 upside down; as they are, no axis
// is 1.8 times smoother than z]
inline constexpr double kFarClearer = 3.0;
// m: a thinner cloud is a slice and has no ground [chosen]
inline constexpr double kThinnest = 3.0;
// Of the longest side: the same [chosen]
inline constexpr double kThinnestShare = 0.02;
// degrees: no ground of a level cloud slopes more; hardly any forest stands on more than 45
// [bound: forests]
inline constexpr double kSteepestDeg = 50.0;
// degrees between z and the direction of the stems: less may be a slope's stand [real clouds,
// docs/method/forest.md]
inline constexpr double kLeastLeanDeg = 12.0;
// Times as often two points share a column along the stems than beside each other [real clouds,
// docs/method/forest.md]
inline constexpr double kLeastGain = 1.42;
// The same gain over that along z [real clouds, docs/method/forest.md]
inline constexpr double kLeastGainOverZ = 1.12;
// m: a taller stand without a unit may be in feet; real clouds have 15 to 28 m, in feet 49 to 92
// [real clouds, docs/method/forest.md]
inline constexpr double kTallForMetres = 42.0;
// m: no stand is taller [bound: the tallest trees have 116 m]
inline constexpr double kTallest = 150.0;
// m, if the numbers were metres: taller ones are millimetres, not centimetres [bound: the tallest
// trees]
inline constexpr double kTallestCentimetres = 4'500.0;
// Share of points alone in their cube; real clouds have 0.5 % [real clouds,
// docs/method/forest.md]
inline constexpr double kMostAlone = 0.8;
// degrees: a cloud as wide is 5 km across; as metres it were narrower than a stem [bound:
// geometry]
inline constexpr double kWidestDegrees = 0.05;
// m: a lower cloud tells nothing of its unit [chosen]
inline constexpr double kLeastHeight = 2.0;
// m: edge of the cubes in which points may be alone [chosen]
inline constexpr double kCube = 3.0;
// Columns at least for a height of the stand [chosen]
inline constexpr std::size_t kLeastColumns = 4;
// Share of the points at each end of an axis that do not count for the extent [not recorded]
inline constexpr double kOutliers = 0.002;
// The upper end of that range [bound: 1 - kOutliers]
inline constexpr double kUpperEnd = 0.998;
// Quantile of the heights in a cell that is its ground [not recorded]
inline constexpr double kLowQuantile = 0.01;
// Quantile of the heights in a cell that is its canopy [not recorded]
inline constexpr double kHighQuantile = 0.98;
// Quantile of the steps between cells that is the rise of the ground within one [not recorded]
inline constexpr double kRiseQuantile = 0.75;
// Quantile of the heights of columns that is the height of the stand [not recorded]
inline constexpr double kHeightQuantile = 0.9;
// Rounds in which the plane of the ground is fitted to what is near it [bound: convergence]
inline constexpr int kPlaneRounds = 6;
// Median distances from the plane beyond which a cell is not near it [not recorded]
inline constexpr double kPlaneMedians = 2.5;
}  // namespace cloud_shape

namespace uphill_side {  // forest/ground/uphill_side.cc
// Directions in which the ground beside a stem is looked at [chosen]
inline constexpr int kDirections = 16;
}  // namespace uphill_side

namespace inventory {  // forest/inventory.cc
// m that a radius gains per metre between two scans of half a stem. That distance is the one that
// outlines tell [tuned on clouds made by hand: 0.38, 0.43 and 0.45 at 3, 6 and 10 cm]
inline constexpr double kThickPerApart = 0.45;
// m: standard deviation of the radius of a stem within foliage, beside that of its fit. Noise
// as wide as the stem hides its width [tuned on lohja1 seed 3]
inline constexpr double kFoliageRadiusSd = 0.006;
// m: least diameter of a tree that is listed, of a full inventory ... [bound: noise of lidars]
inline constexpr double kThinnest = 0.02;
// ... and of a basic one, which a map takes at its end [chosen: from here on trees count]
inline constexpr double kThinnestBasic = 0.05;
// m: edge of the cells that the area of a stand is counted in [chosen]
inline constexpr double kAreaCell = 2.0;
// m above the ground: higher points are no tree [bound: the tallest trees have 116 m]
inline constexpr double kHighest = 120.0;
// m: the origin of slices and stems is a multiple of it. It is itself a multiple of the cells of
// all grids (1.5, 2, 8, 12, 16, 20 and 24 cm; 0.5, 1, 2 and 8 m) [chosen]
inline constexpr double kOriginStep = 48.0;
// m around a stem whose points are kept for a look at it [chosen]
inline constexpr double kSegmentReach = 1.5;
// Returns per square metre near breast height: with fewer, trees are missing [real clouds,
// docs/method/forest.md]
inline constexpr double kSparse = 20.0;
// Of all points, those near breast height: a sparse cloud with a smaller share was taken from above
// [real clouds: 0.025 and 0.06 from aeroplanes]
inline constexpr double kFromAboveShare = 0.12;
// Share of the area where a cloud is dense: from here on the cloud is not called sparse [chosen:
// a walk of 12 s in the open has 0.42]
inline constexpr double kDenseShare = 0.2;
// Share of the cells of the terrain that were seen: with less it is said [not recorded]
inline constexpr double kLeastMeasured = 0.2;
}  // namespace inventory

namespace cloth {  // forest/ground/cloth.cc
// m per step and step: gravity times the squared time step [chosen]
inline constexpr float kFall = 0.02F;
// Share of the speed that stays from step to step [chosen]
inline constexpr float kDamping = 0.98F;
// Share of the way to the mean of the neighbours, per stiffness, as in Zhang et al. 2016 [chosen]
inline constexpr float kPull = 0.7F;
// m: largest movement of a cloth at rest [chosen]
inline constexpr float kSettled = 0.002F;
}  // namespace cloth

namespace ground {  // forest/ground/ground.cc
// m: the lowest point of a cell is supported by another so near above it [chosen]
inline constexpr float kNear = 0.4F;
// m: a point so far under its neighbours is a stray one [chosen]
inline constexpr float kStrayDepth = 0.8F;
// Cells: a touched place that sticks out by more is no ground [not recorded]
inline constexpr double kBumpCells = 0.3;
}  // namespace ground

namespace seen_ground {  // forest/ground/seen_ground.cc
// Cells to each side whose share tells whether ground was seen [tuned on random seeds 4, 9, 16]
inline constexpr int kShareReach = 3;
// Of the median share: cells with more are ground [tuned on random seeds 4, 9, 16]
inline constexpr float kSureShare = 0.8F;
// Cells to each side that the plane under a cell is laid through [tuned on random seeds 4, 9, 16]
inline constexpr int kPlaneReach = 4;
// Cells of ground that make a plane [chosen]
inline constexpr double kLeastCells = 8.0;
// Square cells: the plane's gradient is drawn to the wide one as by so much variance [chosen]
inline constexpr double kPlaneRidge = 4.0;
// Cells to each side that the wide gradient is taken from [chosen]
inline constexpr int kSlopeReach = 16;
// Square cells: the wide gradient is drawn to level ground as by so much variance [chosen]
inline constexpr double kSlopeRidge = 2.0;
// m: ground lies at most so far above the plane [tuned on random seeds 4, 9, 16]
inline constexpr double kAbove = 0.15;
// m more per metre from the nearest ground [tuned on random seeds 4, 9, 16]
inline constexpr double kAbovePerMetre = 0.05;
// Steps of two cells that ground grows outwards [bound: time]
inline constexpr int kMostRounds = 60;
}  // namespace seen_ground

namespace unseen_ground {  // forest/ground/unseen_ground.cc
// m to both sides of a cell: how far it lies off their mean is the roughness of the ground [chosen]
inline constexpr double kLag = 2.0;
// Such differences that tell the roughness [chosen]
inline constexpr std::size_t kLeastBends = 50;
// Median of the absolute value of a standard normal variable [bound: definition]
inline constexpr double kMedianOfNormal = 0.6745;
// Standard deviation 2 m from the nearest seen ground, over the roughness [tuned on random seeds 1,
// 3, 4, 9, 13, 16: docs/method/forest-experiments.md, Unseen ground]
inline constexpr double kSdPerRoughness = 3.0;
// m: terrain is not filled in farther [bound: above the default of ground.max_gap_m]
inline constexpr double kFarthest = 12.0;
}  // namespace unseen_ground

namespace low_noise {  // forest/ground/low_noise.cc
// m: edge of a cell whose layers are counted [chosen]
inline constexpr double kCell = 2.0;
// m: half of a layer's thickness [chosen]
inline constexpr double kStep = 0.5;
// points that make a layer [chosen]
inline constexpr std::uint32_t kLeast = 4;
// Share of a cell's points that make a layer [chosen]
inline constexpr double kLeastShare = 0.004;
// m: points so far under the lowest layer are noise [chosen]
inline constexpr double kMargin = 0.5;
}  // namespace low_noise

namespace height_column {  // forest/ground/height_column.cc
// Of the fullest metre's points: less is a gap or a few ghosts [chosen; measured in
// docs/method/forest.md, Heights]
inline constexpr double kLeastShare = 0.01;
// Times the points of any metre in the sky above: a top [chosen; measured in
// docs/method/forest.md, Heights]
inline constexpr double kDrop = 5.0;
// m above a tip that tell how many ghosts there are [chosen]
inline constexpr int kSky = 8;
// Standard deviations by which a tip's points are more than those [chosen]
inline constexpr double kSigmas = 4.0;
// Points of a metre of a tip that few beams reached, at least: ghosts end less suddenly [tuned on
// random seeds 4, 14, 16, handheld seed 3, and ghosts of the site lake]
inline constexpr double kLeastTip = 5.0;
}  // namespace height_column

namespace low_heights {  // forest/trees/low_heights.h
// Share of all points below which a height counts as empty [chosen: ghosts]
inline constexpr double kFewPoints = 0.001;
// Share of the mean of the metre below that the last full decimetre of a cut has at least [chosen:
// a cut has 1, young pines of lohja1 0.01]
inline constexpr double kCutShare = 0.3;
}  // namespace low_heights

namespace top_judgement {  // forest/top_judgement.cc
// Points in the half metre below the top of a tree whose top was well seen, at least [bound: what a
// top is called seen by]
inline constexpr int kTopPoints = 5;
// m: standard deviation of a height whose top and foot were well seen [chosen]
inline constexpr double kHeightSd = 0.6;
// m: the same where the top was poorly seen [tuned on random seeds 3, 4, 5, 9, 16, handheld 3 and
// lake 3: 0.6 to 1.2 were tried]
inline constexpr double kPoorSd = 1.0;
// m: the same where the height is a lower bound [chosen]
inline constexpr double kBoundSd = 2.0;
// m above a top that have to be seen empty for the height to count [chosen]
inline constexpr double kMargin = 1.0;
// m below and above a top: how well both were seen tells how many points a higher tree would show
// [chosen: the middle of a metre, and the margin]
inline constexpr double kBeside = 1.0;
// Points that the metre above a top would show, did the tree go on: with fewer its height is a
// lower bound [tuned on random seeds 3, 4, 5, 9, 16: 0 to 12 were tried; by chance two show none in
// one case of seven]
inline constexpr double kLeastExpected = 2.0;
// The same for a top that was well seen. It was the limit of a lower bound [tuned on random seeds
// 8, 9, 16 and handheld seeds 3, 4: 5 to 20 were tried]
inline constexpr double kWellExpected = 12.0;
// Points within four metres above a top, at least, with which the tree goes on [tuned on the same
// seeds: 2 to 8 were tried]
inline constexpr int kLeastBeyond = 2;
// Of the points of the metre below the top, the same [tuned on the same seeds: 0 to 0.25 were
// tried]
inline constexpr double kBeyondShare = 0.1;
// Times the points from eight to sixteen metres above: ghosts thin out with height [chosen]
inline constexpr double kGhosts = 4.0;
// m above the ground, of a scanner beside the terrain model [chosen: a person's]
inline constexpr double kScannerHeight = 1.5;
// Places of the scanner that a top is looked at from, about [bound: time]
inline constexpr std::size_t kMostLookouts = 64;
// m of a stem that ends low, and of what is above its end [bound: those that are counted]
inline constexpr double kHalfMetre = 0.5;
// m around it in which things may hide what is above its end [chosen]
inline constexpr double kHidesWithin = 10.0;
// Points that the half metre above its end would show, did it go on: with more it ends there
// [chosen: sight lines are rough, and by chance 40 are there]
inline constexpr double kSureExpected = 40.0;
}  // namespace top_judgement

namespace sight_lines {  // forest/trees/occupied_space.cc
// m: edge of the cubes of a stand that hold points [chosen]
inline constexpr double kCell = 1.0;
// Share of a beam that goes through a cube with points [chosen: exp(-0.36), where foliage has 0.7
// m2 per m3, and half of it stands across]
inline constexpr double kThroughMetre = 0.7;
// m from which a free view counts as one [bound: a unit]
inline constexpr double kUnitRange = 10.0;
// Columns of a stand: of more, blocks with few points are left out [bound: memory]
inline constexpr std::uint64_t kMostCells = 24'000'000;
// Points of such a block, fewer than this [chosen]
inline constexpr std::uint64_t kStray = 20;
}  // namespace sight_lines

namespace view_limit {  // forest/trees/view_limit.cc
// Share of the trees, the thinnest: they do not reach the canopy [chosen]
inline constexpr double kThinShare = 0.4;
// Trees of one distance [chosen]
inline constexpr std::size_t kNear = 20;
// Farther ones that they are compared with [chosen]
inline constexpr std::size_t kFar = 40;
// Trees from one comparison to the next [chosen]
inline constexpr std::size_t kStep = 10;
// Trees of one distance that are higher than the height that was seen there [chosen]
inline constexpr std::ptrdiff_t kRank = 2;
// Share of the farther trees above that height, from which on the view is limited [tuned on random
// seeds 1 to 18, handheld 3 and 4, harvester 3: up to 0.55 by chance]
inline constexpr double kHigherShare = 0.6;
// The same where it is limited nearer to the scanner [tuned on the same seeds: 0.4 and 0.5]
inline constexpr double kStillHigherShare = 0.4;
// Of the height that was seen: lower trees are complete [tuned on the same seeds: 0.3 to 0.7]
inline constexpr double kOfReached = 0.45;
}  // namespace view_limit

namespace tree_owners {  // forest/trees/tree_owners.cc
// m: edge of the cubes that a tree is made of [chosen]
inline constexpr double kVoxel = 0.2;
// Times the length of a way sideways: crowns are higher than wide [tuned on `random` 1 to 6, 8, 13,
// 16, 49 to 51 and 55 to 60: docs/method/forest-experiments.md, crowns]
inline constexpr double kSideways = 3.0;
// Cost of each metre of an axis above the measured part of its stem, metres [tuned likewise]
inline constexpr double kAxisCost = 0.5;
// Times the length of a way downwards: trees grow upwards [chosen]
inline constexpr double kDownwards = 2.0;
// m beyond the surface of a stem: cubes that are its own [chosen]
inline constexpr double kSeedReach = 0.15;
// m: what stands lower beside a stem is undergrowth [chosen]
inline constexpr double kUndergrowth = 1.5;
// m beyond the surface of a stem that are its own there [chosen]
inline constexpr double kStemReach = 0.3;
// m: height of a tree whose top was not seen [chosen]
inline constexpr double kUsualHeight = 20.0;
// m over the top of a tree: higher points are those of another one, or none [chosen]
inline constexpr double kOverTop = 0.5;
// How far from the stem a tree reaches: share of the height ... [chosen]
inline constexpr double kCrownShare = 0.25;
// ... and m, added [chosen]
inline constexpr double kCrownOffset = 1.0;
// m: the same at least [chosen]
inline constexpr double kLeastReach = 1.5;
// m: the same at most [chosen]
inline constexpr double kMostReach = 6.0;
// Cubes along an edge of the larger cubes that lead over gaps [chosen]
inline constexpr std::array<std::int64_t, 2> kBridges = {3, 6};
}  // namespace tree_owners

namespace canopy_crowns {  // forest/trees/canopy_crowns.cc
// Times that the gaps of a canopy model shrink by a cell [chosen]
inline constexpr int kFillPasses = 2;
// Known cells around one that give it their median [chosen]
inline constexpr std::size_t kLeastAround = 5;
// Cells around one that are higher where the pulses went through the crown, at least [chosen: at a
// straight edge five are]
inline constexpr std::size_t kAroundPit = 6;
// m: how much higher [chosen]
inline constexpr float kPit = 2.0F;
}  // namespace canopy_crowns

namespace slice_inventory {  // forest/slice/slice_inventory.cc
// m: one point per cube; a cut has few enough for thin cubes [chosen]
inline constexpr double kThin = 0.005;
// m: edge of the cells that its area is counted in [chosen]
inline constexpr float kAreaCell = 1.0F;
// m: a cloud whose squares are thicker is no cut [chosen: a cut of 20 cm on a slope of 45 degrees
// has 1.2 m in a square; a stand has 5 and more]
inline constexpr double kThickest = 1.5;
// Share of the squares that are no thicker than the thickness of the cut [chosen: single points
// below or above a cut make few squares thick]
inline constexpr double kThinner = 0.9;
// Squares along the longer side of the surface that it is drawn over [bound: memory]
inline constexpr double kMostCells = 1000.0;
}  // namespace slice_inventory

namespace tree_doubt {  // forest/trees/tree_doubt.cc
// Standard deviation over diameter: above, the diameter is doubtful [chosen: the volume of such a
// tree is off by more than a half]
inline constexpr double kWeakShare = 0.3;
// degrees of a stem's circumference: who saw less saw less than a half of it [bound: geometry]
inline constexpr double kHalfTurn = 180.0;
// m above the ground: a stem that shows from there on only shows nothing at breast height [chosen:
// breast height, and the thickness of a slice]
inline constexpr double kHiddenTo = 1.5;
// Doubt of a tree without a height [chosen]
inline constexpr double kNoHeight = 0.5;
// Doubt that the worst standard deviation adds: that of three diameters [chosen]
inline constexpr double kMostShares = 10.0;
// Doubt of a tree without a diameter: more than all that is above [bound: order]
inline constexpr double kNoDiameter = 13.0;
}  // namespace tree_doubt

namespace tree_sheets {  // forest/trees/tree_sheets.cc
// Trees whose points are kept [bound: size of the report, 3,000 of them have 7 MB]
inline constexpr std::size_t kMostSheets = 3'000;
// Points of a front view near the stem [bound: size of the report]
inline constexpr std::size_t kNearPoints = 250;
// The same around it [bound: size of the report]
inline constexpr std::size_t kAroundPoints = 300;
// Points of a cross section [bound: size of the report]
inline constexpr std::size_t kSectionPoints = 250;
// m: edge of the cubes that the points of a front view are rounded to [bound: a step of a picture]
inline constexpr double kCube = 0.04;
// m beyond the surface of a stem: what is drawn as its own [chosen]
inline constexpr double kNear = 0.06;
// m beyond the surface that a cross section shows [chosen]
inline constexpr double kAround = 0.2;
// m above the ground: the layer of the cross sections begins [P4 figs. 9-12]
inline constexpr float kCrossLow = 0.9F;
// m above the ground: it ends [P4 figs. 9-12]
inline constexpr float kCrossHigh = 1.9F;
// m: points so near to the surface show it, at least [chosen: the noise of a lidar]
inline constexpr double kOnSurface = 0.03;
}  // namespace tree_sheets

namespace look_again {  // forest/trees/look_again.cc
// m from a stem: nearer, the lidar sees a low part of it only [bound: geometry]
inline constexpr double kNearest = 2.0;
// m from a stem: farther, its beams are too wide and too few for a thin stem [chosen]
inline constexpr double kFarthest = 8.0;
// m: distance of the places that are tried [chosen: a step]
inline constexpr double kStep = 1.0;
// m beyond the surface of a stem that a person needs [chosen]
inline constexpr double kElbowRoom = 0.5;
// degrees on both sides that a lidar sees of a stem; beyond, its beams graze it [chosen]
inline constexpr double kShownDeg = 62.0;
// degrees of the circumference that have to be new [chosen: half of what is shown]
inline constexpr int kEnoughDeg = 60;
// degrees: with fewer unseen a stem was seen all round, and lacks points [chosen]
inline constexpr int kSeenRoundDeg = 90;
// Places that are told at most [chosen: more are a survey]
inline constexpr std::size_t kMostPlaces = 12;
// Stems that a place has to show [chosen]
inline constexpr std::size_t kLeastStems = 2;
}  // namespace look_again

namespace thin_coverage {  // forest/trees/thin_coverage.cc
// m: edge of the cells that are counted [chosen]
inline constexpr double kCell = 4.0;
// points per m2: less is thin [bound: geometry, see thin_coverage.h]
inline constexpr double kFewPerM2 = 5.0;
}  // namespace thin_coverage

namespace tree_segments {  // forest/trees/tree_segments.cc
// m above the ground: from here on points are kept densely [chosen: the cross section begins there]
inline constexpr double kLowFromM = 0.8;
// m above the ground: up to here [chosen: likewise]
inline constexpr double kLowToM = 2.0;
// m: one point per cube near breast height, where the cross section is drawn [chosen]
inline constexpr double kLowThin = 0.015;
// m: one point per cube elsewhere [chosen]
inline constexpr double kThin = 0.05;
// points of a picture [bound: size of the report]
inline constexpr std::size_t kMostPoints = 60'000;
}  // namespace tree_segments

namespace stem_tiles {  // forest/tiles/stem_tiles.cc
// m beyond a tile: cubes of thinned points that begin in it reach so far [bound: the largest cube]
inline constexpr double kCubeReach = 0.11;
// m beyond a tile: points that a stem in it is measured with [bound: the thickest stem, what is
// looked at around it, and a lean]
inline constexpr double kMeasuredBeyond = 2.5;
// m from breast height: points that the report shows [bound: what it draws]
inline constexpr double kShownReach = 0.65;
// Thinned points of a cloud in tiles that are kept for the report, at most [bound: memory]
inline constexpr std::size_t kMostShown = 2'000'000;
}  // namespace stem_tiles

namespace crown_tiles {  // forest/tiles/crown_tiles.cc
// m beyond a tile: points that decide on tops of stems whose crowns reach into it. A stem leans by
// 3.5 m up to where it is straight, and its top is looked for within 1.5 m [bound: twice that]
inline constexpr double kPointsBeyond = 10.0;
// m beyond a tile: stems that these points may count for [bound: 5 m more]
inline constexpr double kStemsBeyond = 15.0;
// m beyond a tile: points near breast height that its stems may show [bound: a stem's radius]
inline constexpr double kSlicesBeyond = 3.0;
// m beyond a tile: cubes and trees that compete for them [chosen: the reach of three crowns]
inline constexpr double kCrownsBeyond = 18.0;
}  // namespace crown_tiles

}  // namespace understory::forest_constants
