#pragma once

// Numbers of forest/stems/beam_footprint.cc that are no settings. What the words in brackets mean:
// stem_constants.h.
namespace understory::beam_constants {
// Reflectivity of bark [tuned like kOneSided; conifers have 0.2 to 0.45, birch 0.5 to 0.75]
inline constexpr double kBark = 0.5;
// Cosine of incidence at least: bark is rough [chosen]
inline constexpr double kLeastCosine = 0.08;
// Part of a beam that must be on the stem so that half of its echoes are the stem's own. With less,
// the echo from behind is stronger [tuned with kOneSided: 0.1, 0.15 and 0.2 were tried]
inline constexpr double kLeastPart = 0.1;
// Share of the excess of the width that the radius of a stem has which was seen from one side. At
// half a circumference it is half of that. [tuned on maps of `random` by the program's own path,
// with the next two. Seeds: docs/method/forest-experiments.md, noise along the beams]
inline constexpr double kOneSided = 0.92;
// Standard deviations of a beam that the radius grows by from whichever side it was seen
// [tuned likewise]
inline constexpr double kAllSides = 0.51;
// The same, times that of the beam over the radius, by which the fit makes it too small [tuned
// likewise]
inline constexpr double kBesideStem = 1.10;
// m: of thinner stems it does so as of one of this radius [chosen with them]
inline constexpr double kThinRadius = 0.03;
// Radii: a correction is no larger [chosen]
inline constexpr double kMostShare = 0.4;
// Standard deviation of a diameter. Of a stem whose beams are compensated: times the spread of the
// fit ... [tuned: benchmarks/stem_sizes.py]
inline constexpr double kKnownSpread = 2.3;
// ... m at least ... [tuned likewise]
inline constexpr double kKnownLeastSd = 0.0057;
// ... m at 10 m, growing with the square of the range ... [tuned likewise]
inline constexpr double kKnownRangeSd = 0.0023;
// ... and m where a whole beam on bark is as strong as the weakest echo [tuned likewise]
inline constexpr double kKnownWeakSd = 0.0074;
// Of one whose beams are not known: times the spread ... [tuned likewise]
inline constexpr double kWideSpread = 2.6;
// ... m at least ... [tuned likewise]
inline constexpr double kWideLeastSd = 0.0049;
// ... m at 10 m, growing with the square of the range ... [tuned likewise]
inline constexpr double kWideRangeSd = 0.0043;
// ... and m at 10 m, times the part of the circumference that was not seen [tuned likewise]
inline constexpr double kWideOneSided = 0.018;
// Of one whose range is not known, either: times the spread ... [tuned likewise]
inline constexpr double kBareSpread = 6.0;
// ... m at least ... [tuned likewise]
inline constexpr double kBareLeastSd = 0.003;
// ... and m times the part of the circumference that was not seen [tuned likewise]
inline constexpr double kBareOneSided = 0.024;
// Steps over half of a beam [bound: 0.1 mm]
inline constexpr int kBeamSteps = 16;
// Standard deviations that a beam reaches to each side [bound: 1 % is farther out]
inline constexpr double kBeamReach = 2.6;
// Steps from the centre line to where no beam meets the stem [bound: 0.1 mm]
inline constexpr int kAcrossSteps = 100;
// m: nearer places of the scanner count as this far [bound: the mean stays finite]
inline constexpr double kNearest = 0.5;
}  // namespace understory::beam_constants
