#pragma once

#include <cstddef>

// Numbers of forest/stems/range_noise.cc that are no settings. What the words in brackets mean:
// stem_constants.h.
namespace understory::range_noise_constants {
// m around the surface of a stem whose points are looked at [bound: kReach and the most noise]
inline constexpr double kAround = 0.35;
// m by which a leaning stem's points lie farther from its place at breast height [bound: 25 degrees
// over 2.2 m]
inline constexpr double kLeanReach = 1.03;
// m beyond the radius of another stem that belong to it [chosen: as in the search]
inline constexpr double kOthersMargin = 0.06;
// m: radius of a stem at least that shows the noise [chosen: twice the noise of most lidars]
inline constexpr double kLeastRadius = 0.04;
// Returns at least of such a stem [chosen]
inline constexpr int kLeastReturns = 200;
// Stems at least that show it [chosen]
inline constexpr std::size_t kFewestStems = 3;
// Stems at most that are asked [bound: time]
inline constexpr std::size_t kMostStems = 24;
// Cycles of the fit that finds it, at most [bound: convergence; 20 find 3.5 of 4.9 cm]
inline constexpr int kMostCycles = 40;
// Points of each that are taken [bound: time]
inline constexpr int kEnoughPoints = 300;
// Of the scatter to all sides, what a fit begins with along the beams. It stays near that split
// [chosen: lidars, whose beams scatter by a centimetre to the side]
inline constexpr double kFirstShare = 0.7;
// Mean logarithm of the likelihood by which noise along the beams must be likelier, the median over
// the stems. Lidars have such noise, and stems seen from all sides tell less of it than errors of
// the fit do [tuned: docs/method/forest-experiments.md, noise along the beams]
inline constexpr double kLeastLikelier = -0.0045;
// m: less noise changes nothing [bound: a tenth of a millimetre in the diameter]
inline constexpr double kLeastNoise = 0.003;
// m around the surface whose points a fit takes at least ... [chosen: as in the search]
inline constexpr double kFitReach = 0.1;
// ... m ... [tuned on `handheld` 5 and 6, 15 s, with lidar.range_sd_m of 1.2, 3 and 4.5 cm]
inline constexpr double kReach = 0.08;
// ... and so many times the noise beyond [tuned likewise: 2 and 4 were tried, too]
inline constexpr double kReachNoises = 2.5;
// m: a radius or a place that changes by more is not taken ... [chosen]
inline constexpr double kMostChange = 0.03;
// ... and so many times the noise beyond [chosen]
inline constexpr double kMostChangeNoises = 2.0;
}  // namespace understory::range_noise_constants
