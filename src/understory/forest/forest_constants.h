#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

// The fitted and chosen numbers of the layer `forest` that are no settings, which stand in the
// Config structs. One namespace for each file that uses them. A comment gives the unit (none: a
// plain number), the meaning, and in brackets where the number comes from:
//   chosen   by judgement, fitted to nothing
//   bound    by physics, geometry, statistics, memory or time
//   tuned    on the recordings named; where none are, on simulated ones with seeds up to 19
//   not recorded   in use for long, and nothing tells why it is this number
// or real clouds and measurements by their page.
namespace understory::forest_constants {

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
// The upper end of that range [not recorded]
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

namespace inventory {  // forest/inventory.cc
// m: edge of the cells that the area of a stand is counted in [chosen]
inline constexpr double kAreaCell = 2.0;
// m above the ground: higher points are no tree [bound: the tallest trees have 116 m]
inline constexpr double kHighest = 120.0;
// m above a top that have to be seen empty for the height to count [chosen]
inline constexpr double kMargin = 1.0;
// m around a stem whose points are kept for a look at it [chosen]
inline constexpr double kSegmentReach = 1.5;
// Returns per square metre near breast height: with fewer, trees are missing [real clouds,
// docs/method/forest.md]
inline constexpr double kSparse = 20.0;
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
}  // namespace height_column

namespace stem_detector {  // forest/stems/stem_detector.cc
// Share of a stem's directions that show a surface; stems' pieces were filled to 0.67 and more
// [tuned on simulated maps]
inline constexpr double kLeastFill = 0.65;
// Returns a slice: seen well enough for a cut-off piece to be none [tuned on simulated maps]
inline constexpr double kWellSeen = 50.0;
// degrees: steeper leans are rare, and a line through scattered points has them; they have to be
// better supported [tuned on simulated maps]
inline constexpr double kSteepLeanDeg = 8.0;
// Sum of the ratios of points inside and outside of the surface, of a steep stem at most [tuned
// on simulated maps]
inline constexpr double kSteepClutter = 0.25;
// The same of a stem of two rings ... [tuned on simulated maps]
inline constexpr double kClutterOfTwo = 0.34;
// ... and what each further ring adds: in a thicket it takes many slices that agree [tuned on
// simulated maps]
inline constexpr double kClutterPerRing = 0.085;
// The same at most [tuned on simulated maps]
inline constexpr double kMostClutter = 0.65;
// m: scatter from which few rings have to be clean [tuned on simulated maps]
inline constexpr double kNoisyScatter = 0.029;
// rings that are few then [tuned on simulated maps]
inline constexpr double kFewRings = 6.0;
// Sum of the ratios at most then [tuned on simulated maps]
inline constexpr double kNoisyClutter = 0.4;
// m: radius of a slim column that may stand alone [tuned on simulated maps]
inline constexpr double kSlimRadius = 0.1;
// Ratio of points outside of it at most [tuned on simulated maps]
inline constexpr double kAloneOutside = 0.12;
// degrees that it leans at most [tuned on simulated maps]
inline constexpr double kAloneLeanDeg = 10.0;
// m that it extends at least [tuned on simulated maps]
inline constexpr double kAloneExtent = 1.5;
// Share of its slices that show it [tuned on simulated maps]
inline constexpr double kAloneSlices = 0.85;
// degrees of its circle that are seen evenly [tuned on simulated maps]
inline constexpr double kAloneArcDeg = 90.0;
// Share of the slices between its ends that show a stem [tuned on simulated maps]
inline constexpr double kLeastSliceShare = 0.6;
// m that a stem extends at least [tuned on simulated maps]
inline constexpr double kLeastExtent = 0.7;
// m over breast height: what begins higher is a branch or a crown [tuned on simulated maps]
inline constexpr double kBeginsAbove = 0.3;
// Share of the seen arc that has to be seen evenly [tuned on simulated maps]
inline constexpr double kEvenArcShare = 0.35;
// m: error of a diameter at most ... [tuned on simulated maps]
inline constexpr double kDbhSd = 0.01;
// ... and of the diameter, added [tuned on simulated maps]
inline constexpr double kDbhSdShare = 0.08;
// Sum of the ratios of what only thick slices show, where points are many [tuned on simulated
// maps]
inline constexpr double kThickOnlyClutter = 0.25;
// m: scatter of it [tuned on simulated maps]
inline constexpr double kThickOnlyScatter = 0.025;
// Ratio of points inside a stem at most [tuned on simulated maps]
inline constexpr double kMostInside = 0.35;
// Sum of the ratios of a stem that shows in few slices [tuned on simulated maps]
inline constexpr double kFewSlicesClutter = 0.25;
// radii: error of its radius at most [tuned on simulated maps]
inline constexpr double kFewSlicesSd = 0.35;
// Slices that a thick one of the second search holds [not recorded]
inline constexpr double kThickSlices = 3.0;
// Thick slices that show a stem at least [not recorded]
inline constexpr int kLeastThickSlices = 2;
// m: distance of connected points in a thin slice [not recorded]
inline constexpr double kThinReach = 0.08;
// m: the same in a thick slice [not recorded]
inline constexpr double kThickReach = 0.12;
// m: half of the width of a circle's band in a thin slice [not recorded]
inline constexpr double kThinBand = 0.02;
// m: the same in a thick slice [not recorded]
inline constexpr double kThickBand = 0.025;
// Of the least diameter: radius of a circle at least, as the edge of a stem is blurred [not
// recorded]
inline constexpr double kLeastRadiusShare = 0.4;
// Radii: scatter of a column that stands alone at most ... [not recorded]
inline constexpr double kAloneScatterShare = 0.4;
// ... and m, added [not recorded]
inline constexpr double kAloneScatter = 0.006;
// Share of the least arc that has to be seen evenly [not recorded]
inline constexpr double kEvenArcOfLeast = 0.8;
// Points a slice: more are many [not recorded]
inline constexpr int kDensePointsPerSlice = 12;
// m: scatter of a stem at most, or ... [not recorded]
inline constexpr double kMostScatter = 0.012;
// ... radii, whichever is more ... [not recorded]
inline constexpr double kMostScatterShare = 0.2;
// ... and m, added to either [not recorded]
inline constexpr double kScatterSlack = 0.008;
// Share of all slices that show a stem without a doubt [not recorded]
inline constexpr double kShownByMost = 0.8;
// Share of all slices below which a piece that was seen well is cut off [not recorded]
inline constexpr double kShownByFew = 0.4;
// Stems whose centres are nearer than this share of both radii are one [not recorded]
inline constexpr double kSameOfBoth = 0.85;
// So are stems whose centres are nearer than the larger radius and this share of the smaller one
// [not recorded]
inline constexpr double kSameOfSmaller = 0.3;
// Scatters: points so near to the surface are those of the stem [not recorded]
inline constexpr double kClaimScatters = 2.5;
// m: the same at least [not recorded]
inline constexpr double kClaimBand = 0.015;
// m around the radius in which points of a leaning stem are looked for [not recorded]
inline constexpr double kLeanReach = 1.2;
// m beyond the radius whose points belong to a stem [not recorded]
inline constexpr double kExplainedMargin = 0.06;
// m beyond the radius of a start in which its points are looked for [not recorded]
inline constexpr double kStartReach = 0.4;
// m beyond the radius whose points enter the fit [not recorded]
inline constexpr double kFitReach = 0.35;
}  // namespace stem_detector

namespace ring_linker {  // forest/stems/ring_linker.cc
// m: edge of the cells in which rings of other slices are looked for [chosen]
inline constexpr double kRingCell = 1.0;
// m by which the radii of two rings of one stem differ at most ... [not recorded]
inline constexpr double kSameRadius = 0.03;
// ... and of the larger radius, added [not recorded]
inline constexpr double kSameRadiusShare = 0.3;
// m to the side of a ring where the next one of a vertical stem may lie [not recorded]
inline constexpr double kBesideReach = 0.05;
// m that a ring may lie off the line at most ... [not recorded]
inline constexpr double kOffLine = 0.04;
// ... and radii, added [not recorded]
inline constexpr double kOffLineShare = 0.2;
}  // namespace ring_linker

namespace stem_fit {  // forest/stems/stem_fit.cc
// m/m: radius lost per metre of height in a stem's lower part [chosen]
inline constexpr double kUsualTaper = -0.008;
// m/m: how far stems differ from it [chosen]
inline constexpr double kTaperSd = 0.006;
// m/m: how far the slope may leave that of the rings [chosen]
inline constexpr double kSlopeSd = 0.05;
// m: scatter of points about a stem, at least [bound: noise of lidars]
inline constexpr double kLeastScatter = 0.004;
// m: scatter of points about a stem, at most [chosen]
inline constexpr double kMostScatter = 0.03;
// 1/m: what the error of a radius grows by with its own square [tuned on handheld seeds 1 and 2,
// harvester seed 1, true poses: 95 % within two standard deviations]
inline constexpr double kSquare = 1400.0;
// Times the fit's own error: returns are not independent [tuned like kSquare]
inline constexpr double kLinear = 1.5;
// m of the radius: keyframes do not quite lie on each other, stems are not round [tuned like
// kSquare]
inline constexpr double kMapError = 0.002;
// points that a fit takes [bound: time]
inline constexpr std::size_t kEnoughPoints = 400;
// Scatters beyond which a point has no weight (Tukey) [not recorded]
inline constexpr double kReachScatters = 4.0;
// m from the surface of the start: points that a fit takes [not recorded]
inline constexpr double kSampleReach = 0.15;
// Scatters: points so near to the surface are on it [not recorded]
inline constexpr double kBandScatters = 2.5;
// m: the same at least [not recorded]
inline constexpr double kLeastBand = 0.015;
// Bands under the surface from which on a point is inside ... [not recorded]
inline constexpr double kInsideBands = 2.0;
// ... or radii under it, whichever is more [not recorded]
inline constexpr double kInsideShare = 0.3;
// m: radius of a thin start at least [not recorded]
inline constexpr double kThinRadius = 0.02;
// Spreads of the points in the plane that make its radius [not recorded]
inline constexpr double kThinSpreads = 0.7;
// m: scatter that a fit begins with at least [not recorded]
inline constexpr double kFirstScatter = 0.015;
// m from the surface: points that tell the scatter [not recorded]
inline constexpr double kScatterReach = 0.05;
// Steps of a fit at most [bound: convergence]
inline constexpr int kMostSteps = 12;
// m: a fit that steps farther has failed [not recorded]
inline constexpr double kLongestStep = 0.3;
// Of the least diameter: a fit with a smaller radius has failed [not recorded]
inline constexpr double kLeastRadiusShare = 0.3;
// Steps before the scatter is taken from the points [not recorded]
inline constexpr int kFixedScatterSteps = 3;
// m: a fit whose step is shorter has ended [not recorded]
inline constexpr double kSettled = 2e-4;
// m outside of the surface: points that the noisy cylinder is fitted to [not recorded]
inline constexpr double kRefineReach = 0.1;
// Radii: with more scatter a thin stem is tried as well [not recorded]
inline constexpr double kThinTryScatter = 0.12;
// Share of the directions that show a surface: with less a thin stem is tried [not recorded]
inline constexpr double kThinTryFill = 0.7;
// Share of the arc that is seen evenly: with less a thin stem is tried [not recorded]
inline constexpr double kThinTryArc = 0.5;
// Share of points off the surface that a thin stem may have more [not recorded]
inline constexpr double kThinStrays = 0.05;
}  // namespace stem_fit

namespace noisy_cylinder {  // forest/stems/noisy_cylinder.cc
// m: scatter of ranges at least [bound: noise of lidars]
inline constexpr double kLeastScatter = 0.004;
// m: scatter of ranges at most [chosen]
inline constexpr double kMostScatter = 0.06;
// Directions from which a stem may have been seen [chosen]
inline constexpr int kViews = 24;
// Share of a direction that gave nothing: keeps logarithms finite [bound: rounding]
inline constexpr double kLeastView = 1e-4;
// m: scatter that a fit begins with at least [not recorded]
inline constexpr double kFirstScatterLeast = 0.01;
// m: the same at most [not recorded]
inline constexpr double kFirstScatterMost = 0.03;
// m beyond the radius over which points of no stem are spread [not recorded]
inline constexpr double kStrayReach = 0.1;
// Points of a fit at least [bound: six parameters]
inline constexpr std::size_t kFewestPoints = 8;
// m: a fit whose step is shorter has ended [not recorded]
inline constexpr double kSettled = 4e-5;
// Times that an extrapolation goes beyond a step at most [not recorded]
inline constexpr double kMostStretch = 6.0;
// Scatters between places on the circumference: the scatter blurs the gaps [not recorded]
inline constexpr double kBinScatters = 0.8;
// Places on the circumference at least [not recorded]
inline constexpr double kFewestBins = 24.0;
// Places on the circumference at most [bound: time]
inline constexpr double kMostBins = 160.0;
// Standard deviations of the angle from which a point may have come [bound: the rest is below 0.1
// %]
inline constexpr double kBlurReach = 3.5;
// Share of the points that must lie on the surface [not recorded]
inline constexpr double kLeastWeight = 0.2;
// m: a fit with a smaller radius has failed [not recorded]
inline constexpr double kLeastRadius = 0.008;
// m: a fit that goes farther from its start has failed [not recorded]
inline constexpr double kFarthest = 0.5;
// Share of points off the surface that a fit begins with [not recorded]
inline constexpr double kFirstStrays = 0.05;
// The same at least [not recorded]
inline constexpr double kLeastStrays = 0.005;
// The same at most [not recorded]
inline constexpr double kMostStrays = 0.5;
// Rounds in which the seen directions are found [bound: convergence]
inline constexpr int kViewRounds = 4;
}  // namespace noisy_cylinder

namespace stem_surroundings {  // forest/stems/stem_surroundings.cc
// m: edge of the squares that know the stems nearby [chosen]
inline constexpr double kSquare = 1.0;
// m: one point per cube [chosen]
inline constexpr double kCube = 0.02;
// m around the surface whose points are kept at breast height ... [chosen]
inline constexpr double kReach = 0.2;
// ... and m per metre above it, added: stems bend [chosen]
inline constexpr double kReachPerMetre = 0.03;
// m above the ground: higher points are no tree [bound: the tallest trees have 116 m]
inline constexpr double kHighest = 120.0;
// Points that are gathered before they are thinned [bound: memory]
inline constexpr std::size_t kFirstLimit = 2'000'000;
}  // namespace stem_surroundings

namespace stem_curve {  // forest/stems/stem_curve.cc
// m between the sections that are fitted [chosen]
inline constexpr double kStep = 0.25;
// m: half of the height of a section [chosen]
inline constexpr double kHalfWindow = 0.3;
// m between the sections of a curve [bound: by decimetres]
inline constexpr double kSectionStep = 0.1;
// m: a top so near over a section needs none of its own [bound: the decimals of stem_curves.csv]
inline constexpr double kSameHeight = 0.01;
// m above the ground: the lowest section that is fitted [chosen]
inline constexpr double kLowest = 0.3;
// m: up to here roots make a stem thicker than its form [chosen]
inline constexpr double kFlareEnd = 1.0;
// m/m: radius lost per metre of height [as in stem_fit]
inline constexpr double kUsualTaper = -0.008;
// m of the radius: thinner stems are not followed [chosen]
inline constexpr double kThinnest = 0.015;
// m without a section after which a stem is not followed any more [chosen]
inline constexpr double kLongestGap = 2.0;
// m of the radius by which a prediction is wrong [chosen]
inline constexpr double kPredictionSd = 0.006;
// Share of a section's shift that turns the axis [chosen]
inline constexpr double kSlopeGain = 0.15;
// m around the predicted surface whose points enter a fit [chosen]
inline constexpr double kFitReach = 0.1;
// Share of the points that belong to something else at most [chosen]
inline constexpr double kMostStrays = 0.45;
// Times the fit's own error: returns are not independent [as in stem_fit]
inline constexpr double kLinear = 1.5;
// 1/m: what the error of a radius grows by with its own square [as in stem_fit]
inline constexpr double kSquare = 1400.0;
// m of the radius: keyframes do not quite lie on each other [as in stem_fit]
inline constexpr double kMapError = 0.002;
// Radii: error of a section at most ... [chosen]
inline constexpr double kMostSdShare = 0.12;
// ... and m, added [chosen]
inline constexpr double kMostSd = 0.003;
// Radii: scatter of a section's points at most ... [as in stem_detector]
inline constexpr double kMostScatterShare = 0.2;
// ... and m, added [as in stem_detector]
inline constexpr double kMostScatter = 0.012;
// m: shift of a section from where it was expected at most ... [chosen]
inline constexpr double kMostShift = 0.03;
// ... and radii, added [chosen]
inline constexpr double kMostShiftShare = 0.2;
// Radii: change from the expected radius at most ... [chosen]
inline constexpr double kMostChangeShare = 0.1;
// ... and m, added [chosen]
inline constexpr double kMostChange = 0.01;
// Radii: the same growth towards the roots [chosen]
inline constexpr double kFlare = 0.5;
// Scatters: points so near to the surface are on it [as in stem_fit]
inline constexpr double kBandScatters = 2.5;
// m: the same at least [as in stem_fit]
inline constexpr double kLeastBand = 0.015;
// Bands under the surface from which on a point is inside ... [as in stem_fit]
inline constexpr double kInsideBands = 2.0;
// ... or radii under it, whichever is more [as in stem_fit]
inline constexpr double kInsideShare = 0.3;
// Points inside a section over those on it at most [chosen]
inline constexpr double kMostInside = 0.3;
// Points on a section at least [chosen]
inline constexpr int kFewestPoints = 10;
// degrees of a section that are seen at least [chosen]
inline constexpr double kLeastArcDeg = 60.0;
// Power of the distance to the top that a stem's diameter follows: most stems lie between a
// paraboloid (0.5) and a cone (1) [bound: Laasasenaho 1982 has 0.6 to 0.7 for pine and spruce]
inline constexpr double kUsualPower = 0.7;
// How far stems differ from it [chosen]
inline constexpr double kPowerSd = 0.12;
// The least power that is tried [chosen]
inline constexpr double kLeastPower = 0.4;
// The greatest one [chosen]
inline constexpr double kMostPower = 1.2;
// The step between those that are tried [chosen]
inline constexpr double kPowerStep = 0.02;
// Sections that share errors, such as those of the map [chosen]
inline constexpr double kCorrelatedRings = 4.0;
// m of the radius: sections scatter about the form by that at least [chosen]
inline constexpr double kLeastSpread = 0.004;
// Spreads beyond which a section does not belong to the stem [chosen]
inline constexpr double kOutlierSpreads = 3.0;
// m of height over which sections are averaged: one standard deviation [chosen]
inline constexpr double kSmoothing = 0.35;
// Diameters per metre beyond what was seen: error of the form ... [chosen]
inline constexpr double kModelSdPerMetre = 0.03;
// ... and at most [chosen]
inline constexpr double kMostModelSd = 0.25;
// Heights of the last section: where the outline of a tree of unknown height ends [chosen]
inline constexpr double kUnknownTop = 2.0;
// m: lower trees have no stem curve [bound: breast height]
inline constexpr double kLeastTop = 2.0;
}  // namespace stem_curve

namespace standing_direction {  // forest/stems/standing_direction.cc
// m: one point each, or what is near would count most [chosen]
inline constexpr double kVoxel = 0.2;
// m: edge of the cells whose lowest point is the ground [chosen]
inline constexpr double kGroundCell = 2.0;
// m: points above that are looked at [chosen]
inline constexpr double kAboveGround = 1.5;
// Voxels that are looked at [bound: time]
inline constexpr std::size_t kMostVoxels = 60'000;
// Voxels at least, or nothing is told [chosen]
inline constexpr std::size_t kLeastVoxels = 2'000;
// degrees from z: directions farther away are not tried [chosen]
inline constexpr double kFarthestDeg = 72.0;
// degrees from z: nearer directions count as z [chosen]
inline constexpr double kNearZDeg = 6.0;
// m: edge of a column in the first search [chosen]
inline constexpr double kCoarseCell = 1.0;
// degrees between the directions of the first search [chosen]
inline constexpr double kCoarseDeg = 6.0;
// m: edge of a column in the last search [chosen]
inline constexpr double kCell = 0.5;
// Directions of the first search that are looked at closely [chosen]
inline constexpr std::size_t kFinalists = 4;
// Columns to those that are compared with [chosen]
inline constexpr int kApart = 3;
// Columns at most [bound: memory]
inline constexpr double kMostCells = 4e6;
}  // namespace standing_direction

namespace tree_heights {  // forest/trees/tree_heights.cc
// m around a stem in which its top is looked for [chosen]
inline constexpr double kCrownReach = 1.5;
// m: edge of the squares that know the stems nearby [chosen]
inline constexpr double kCell = 1.0;
// m without points that a crown may begin after [chosen]
inline constexpr int kLargestGap = 3;
// m over the slices: less is no tree top [chosen]
inline constexpr double kLeastAbove = 1.5;
// m above breast height over which a stem leans as it does below; farther up it stands upright
// [not recorded]
inline constexpr double kStraight = 6.0;
}  // namespace tree_heights

namespace tree_owners {  // forest/trees/tree_owners.cc
// m: edge of the cubes that a tree is made of [chosen]
inline constexpr double kVoxel = 0.2;
// Times the length of a way sideways: crowns are higher than wide [chosen]
inline constexpr double kSideways = 1.5;
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

namespace tree_crowns {  // forest/trees/tree_crowns.cc
// m: height of the layers of a crown [chosen]
inline constexpr double kLayer = 0.5;
// Directions in which the width of a layer is measured [chosen]
inline constexpr int kSectors = 16;
// Directions from one with points to the next: wider gaps are no part of the crown [chosen]
inline constexpr std::size_t kWidestGap = 5;
// m beyond the surface of the stem: what reaches farther is a branch [chosen]
inline constexpr double kBranch = 0.35;
// Quantile of the widths of the layers that is the width of a tree [chosen]
inline constexpr double kWideQuantile = 0.9;
// Of that width: narrower layers are no crown yet [chosen]
inline constexpr double kBaseShare = 0.35;
// Layers at the base of a crown ... [chosen]
inline constexpr int kBaseLayers = 5;
// ... and how many of them are wide [chosen]
inline constexpr int kLeastWideLayers = 3;
// Share of the cubes in a direction that lie within the edge of the crown [chosen]
inline constexpr double kEdgeQuantile = 0.97;
}  // namespace tree_crowns

namespace tree_segments {  // forest/trees/tree_segments.cc
// m: one point per cube near breast height, where the cross section is drawn [chosen]
inline constexpr double kLowThin = 0.015;
// m: one point per cube elsewhere [chosen]
inline constexpr double kThin = 0.05;
// points of a picture [bound: size of the report]
inline constexpr std::size_t kMostPoints = 60'000;
}  // namespace tree_segments

namespace circle_search {  // forest/stems/circle_search.cc
// Pairs of points that are tried with a drawn one [bound: time]
inline constexpr int kTriesPerDraw = 9;
// m: edge of the cells that count points on a circle [bound: time]
inline constexpr float kFineCell = 0.08F;
// m: edge of the cells that points are drawn from [bound: time]
inline constexpr float kCoarseCell = 0.3F;
// Cells of a row between which points are moved up where others are taken away [bound: time]
inline constexpr int kStretch = 64;
// m: around a sampled circle that points are gathered to fit it to, at first [bound: time]
inline constexpr double kRefineMargin = 0.1;
// Points of a group that are sorted anew when the lowest of them goes, at most [bound: time]
inline constexpr std::size_t kMostSortedAnew = 500'000;
// Share of the seen arc that has to be seen evenly [not recorded]
inline constexpr double kEvenArcShare = 0.3;
// Bands: scatter of a circle at most, or ... [not recorded]
inline constexpr double kMostScatterBands = 0.6;
// ... radii, whichever is more [not recorded]
inline constexpr double kMostScatterShare = 0.12;
// m: distances of the three points that a circle is drawn through, in turn [not recorded]
inline constexpr std::array<float, 4> kScales = {0.08F, 0.2F, 0.45F, 0.9F};
// Draws of a group at least [bound: time]
inline constexpr std::size_t kFewestDraws = 24;
// Points of a group for each further draw [bound: time]
inline constexpr std::size_t kPointsPerDraw = 8;
// Draws of a group at most [bound: time]
inline constexpr std::size_t kMostDraws = 150;
// m: a circle counts by the power 0.7 of its radius and this [not recorded]
inline constexpr double kLengthOffset = 0.15;
// Points on a circle that one inside it outweighs [not recorded]
inline constexpr double kInsideWeight = 1.5;
}  // namespace circle_search

}  // namespace understory::forest_constants
