#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

// The numbers of curves along stems that are no settings, in the form of forest_constants.h.
namespace understory::stem_constants {

namespace stem_surroundings {  // forest/stems/stem_surroundings.cc
// m: edge of the squares that know the stems nearby [chosen]
inline constexpr double kSquare = 1.0;
// m: one point per cube [chosen]
inline constexpr double kCube = 0.02;
// m around the surface whose points are kept at breast height ... [chosen]
inline constexpr double kReach = 0.2;
// ... and m per metre above it, added: stems bend [chosen]
inline constexpr double kReachPerMetre = 0.03;
// m around the surface that show a second stem above a fork ... [as in stem_fork]
inline constexpr double kForkReach = 0.7;
// ... up to that height above the ground, m [as in stem_fork]
inline constexpr double kForksUpTo = 12.0;
// m above the ground: higher points are no tree [bound: the tallest trees have 116 m]
inline constexpr double kHighest = 120.0;
// Points that are gathered before they are thinned [bound: memory]
inline constexpr std::size_t kFirstLimit = 2'000'000;
}  // namespace stem_surroundings

namespace stem_fork {  // forest/form/stem_fork.cc
// m between the sections of a curve [as in stem_curve]
inline constexpr double kSectionStep = 0.1;
// m above the ground: the slices begin [chosen]
inline constexpr double kLowest = 0.75;
// ... and end, at most [chosen: higher forks are in the crown]
inline constexpr double kHighest = 12.0;
// m over the last section of the stem, to which slices are searched [chosen]
inline constexpr double kBeyond = 1.5;
// m: height of a slice [as in stem_detector]
inline constexpr double kSlice = 0.25;
// m from the surface: nearer points are of the stem [chosen: bark and scatter]
inline constexpr double kBark = 0.025;
// ... farther ones of others [chosen]
inline constexpr double kReach = 0.7;
// m of the radius: thinner ones are branches [chosen]
inline constexpr double kThinnest = 0.015;
// Radii of the stem: a second stem has at least so many ... [chosen]
inline constexpr double kLeastShare = 0.35;
// ... and at most [chosen]
inline constexpr double kMostShare = 1.3;
// Sum of both radii: centres lie at least so far apart [chosen]
inline constexpr double kLeastApart = 0.8;
// Points inside of a section per point on it, at most [chosen]
inline constexpr double kMostInside = 0.3;
// Slices that show it, at least [chosen: half a metre]
inline constexpr int kFewestSlices = 3;
// Degrees: a branch leans more [chosen]
inline constexpr double kMostLeanDeg = 40.0;
// m/m: it goes away from the stem by that at least [chosen]
inline constexpr double kLeastSlope = 0.08;
// m above the ground: a lower fork is two trees [chosen]
inline constexpr double kLowestFork = 0.2;
// m from the fork to where it was seen, at most [chosen]
inline constexpr double kLongestHidden = 1.5;
// m from a section within which a point is on it [as in circle_search]
inline constexpr double kBand = 0.02;
// m outside of it within which others speak against it: foliage [chosen]
inline constexpr double kAround = 0.12;
// Weights of the logistic regression that tells a second stem from foliage and branches. The
// constant. [tuned: random seeds 1, 2, 4-10, 13, 20 s, with stand.fork_share=0.2: 2,228 candidates,
// of which 425 on forked trees; page forest-experiments.md, "Forks and snags"]
inline constexpr double kBase = -4.4;
// Log of the slices with a section [tuned: the same]
inline constexpr double kByCount = 1.2;
// Their share of the slices between the first and the last [tuned: the same]
inline constexpr double kByFill = 1.37;
// m that sections are off the plane through the stem, root mean square [tuned: the same]
inline constexpr double kByOffLine = -3.04;
// That counts up to here [chosen]
inline constexpr double kMostOffLine = 0.3;
// Log of the points on a section ... [tuned: the same]
inline constexpr double kByPoints = 0.75;
// ... and of those outside per point on it [tuned: the same]
inline constexpr double kByOutside = -0.43;
// What is added before that logarithm [chosen: a tenth]
inline constexpr double kLittle = 0.1;
// Log of the points on it per point on the stem in the same slices [tuned: the same]
inline constexpr double kByShare = 1.22;
// What is added before that one [chosen]
inline constexpr double kLittleShare = 0.05;
// That share counts up to here [chosen]
inline constexpr double kFullShare = 1.5;
// A fork is told from that on [tuned: the same; 0 finds 15 % more, with twice as many false ones]
inline constexpr double kLeastEvidence = 0.5;
// Seed of the draws: the same points give the same fork [chosen]
inline constexpr std::uint64_t kSeed = 1;
}  // namespace stem_fork

namespace shared_feet {  // forest/form/shared_feet.cc
// m/m between two slopes, below which centre lines are parallel [chosen]
inline constexpr double kParallel = 0.01;
// m that roots add to the radii of two stems [chosen]
inline constexpr double kFlare = 0.05;
// m above the ground at which the centre lines ... [chosen]
inline constexpr double kAbove = 3.0;
// ... are farther apart than where they are nearest, m [chosen]
inline constexpr double kOpens = 0.1;
// m between stems at breast height, at most, along each axis [chosen]
inline constexpr double kFarthest = 1.5;
}  // namespace shared_feet

namespace stem_curve {  // forest/form/stem_curve.cc
// m between the sections that are fitted [chosen]
inline constexpr double kStep = 0.25;
// m: half of the height of a section [chosen]
inline constexpr double kHalfWindow = 0.3;
// m between the sections of a curve [bound: by decimetres]
inline constexpr double kSectionStep = 0.1;
// m above the ground: the sweep of a stem is taken from here ... [bound: above the roots]
inline constexpr double kSweepFrom = 0.5;
// ... to here [bound: a sawlog]
inline constexpr double kSweepTo = 5.0;
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
// Radii: a section is thinner than expected by that at most ... [chosen]
inline constexpr double kMostChangeShare = 0.1;
// ... and m, added [chosen]
inline constexpr double kMostChange = 0.01;
// Radii: above breast height it is thicker than expected by that at most ... [tuned on random seeds
// 1, 4, 10, 13 and handheld 3, 4: 0.03 to 0.1]
inline constexpr double kMostThickerShare = 0.05;
// ... and m, added [tuned on the same seeds: 0.005 to 0.01]
inline constexpr double kMostThicker = 0.005;
// Radii: the growth from section to section towards the roots [chosen]
inline constexpr double kFlare = 0.5;
// Points inside a section over those on it at most [chosen]
inline constexpr double kMostInside = 0.3;
// Points on a section at least [chosen]
inline constexpr int kFewestPoints = 10;
// degrees of a section that are seen at least [chosen]
inline constexpr double kLeastArcDeg = 60.0;
// Points of a section that tell as much of how far around it was seen as the arc of the whole stem
// [tuned on random seeds 8, 9 and 16 with beam.sensor: 0, 30, 100 and all]
inline constexpr double kArcPoints = 100.0;
// m from breast height: sections that tell how much thicker all are than the stem there [chosen]
inline constexpr double kAnchorReach = 0.8;
// Sections without an offset that count beside them [chosen]
inline constexpr double kAnchorPrior = 1.0;
// Power of the distance to the top that a stem's diameter follows. Most stems lie between a
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
// Heights of the last section: where the outline of a tree of unknown height ends [chosen]
inline constexpr double kUnknownTop = 2.0;
// m: lower trees have no stem curve [bound: breast height]
inline constexpr double kLeastTop = 2.0;
}  // namespace stem_curve

namespace breast_height_sections {  // forest/stems/breast_height_sections.cc
// The sections are those of a stem curve.
using stem_curve::kFewestPoints;
using stem_curve::kHalfWindow;
using stem_curve::kLinear;
using stem_curve::kMostChange;
using stem_curve::kMostChangeShare;
using stem_curve::kMostShift;
using stem_curve::kMostShiftShare;
using stem_curve::kMostStrays;
using stem_curve::kStep;
using stem_curve::kUsualTaper;
// Sections above breast height, and as many below it [chosen]
inline constexpr int kSectionsBeside = 2;
// Of the arc that the whole stem shows, what a section shows at least [tuned on harvester seed 3
// and the stems of kConeSd: none, 0.75 and 0.9 were tried]
inline constexpr double kLeastArcShare = 0.75;
// m of a radius: what sections differ by beside their noise [chosen]
inline constexpr double kOwnSd = 0.002;
// Sections at least [chosen]
inline constexpr int kFewestSections = 3;
// m of the radius: what stems differ by from the cone of the whole fit [tuned: 0.002 to 0.005, on
// the maps of docs/method/forest-experiments.md, sections at breast height]
inline constexpr double kConeSd = 0.003;
// Sections that share their errors: they overlap [tuned with kConeSd: 1 to 6]
inline constexpr double kShared = 3.0;
}  // namespace breast_height_sections

}  // namespace understory::stem_constants
