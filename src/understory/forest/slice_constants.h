#pragma once

#include <array>
#include <cstddef>

// The numbers of stems in one thin cut that are no settings, in the form of forest_constants.h.
namespace understory::stem_constants {

namespace slice_stems {  // forest/slice/slice_stems.cc
// m: halves of the widths of the bands that circles are searched with: sharp clouds, then those
// that scatter or show two rings [chosen]
inline constexpr std::array<double, 2> kBands = {0.01, 0.025};
// m: points nearer to each other hang together [as kThinReach of stem_detector]
inline constexpr double kReach = 0.08;
// Of the radius of the thinnest stem: smaller circles are not kept [as in stem_detector]
inline constexpr double kLeastRadiusShare = 0.4;
// m from the surface: points that a fit looks at [as NoisyCylinderConfig::stray_reach_m and what
// lies beyond]
inline constexpr double kFitReach = 0.35;
// m: scatter of the sharpest clouds [as in stem_fit]
inline constexpr double kLeastScatter = 0.004;
// Of the arc that was seen: what it would be if the points lay evenly [as in stem_detector]
inline constexpr double kEvenArcShare = 0.35;
// Points on the surface for each one inside, at least [as in stem_detector]
inline constexpr int kInsideTimes = 4;
// Density just inside of the surface over that on it [as in stem_detector]
inline constexpr double kMostInside = 0.35;
// The same inside and outside, added [as kMostClutter of stem_detector]
inline constexpr double kMostClutter = 0.65;
// m: scatter of a stem's points [as in stem_detector]
inline constexpr double kMostScatter = 0.012;
// Of the radius: the same for thick stems, which may be ribbed or show two rings [as in
// stem_detector]
inline constexpr double kMostScatterShare = 0.2;
// Of the radius: where points scatter more ... [chosen]
inline constexpr double kNoisyShare = 0.12;
// ... the density beside the surface over that on it, inside and outside, added [chosen: random
// points have 0.3 and more]
inline constexpr double kNoisyClutter = 0.25;
// degrees: an arc may be a piece of a wall or of an outline that is no circle up to here [chosen]
inline constexpr double kWallArcDeg = 220.0;
// m beyond the surface: the outline of a stem that was seen from one side goes on no farther
// [chosen]
inline constexpr double kOutlineReach = 0.1;
// Of the points within that reach, those on the surface of such a stem [chosen: 0.9 where it stands
// alone, 0.3 to 0.6 on buttresses, docs/method/forest.md]
inline constexpr double kOutlineShare = 0.7;
// Scatter about a circle over that about a line: more is no circle [chosen: a line has 2 and more,
// an arc of 60 degrees 0.5]
inline constexpr double kLineTimes = 0.8;
// Of the sum of two radii: nearer stems are one [chosen: touching stems bulge]
inline constexpr double kLeastApart = 0.85;
// m to both sides of the surface in which a second ring is looked for [chosen]
inline constexpr double kProfileReach = 0.1;
// m: step of that [chosen]
inline constexpr double kProfileStep = 0.004;
// Of the first ring's points per step: fewer are no second ring [chosen]
inline constexpr double kSecondSummit = 0.35;
// Of the second ring's points per step: more between the rings make them one [chosen]
inline constexpr double kValley = 0.5;
}  // namespace slice_stems

}  // namespace understory::stem_constants
