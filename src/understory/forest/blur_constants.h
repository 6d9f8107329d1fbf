#pragma once

#include <cstddef>

// The fitted and chosen numbers of the search for stems in blurred clouds that are no settings. A
// blur is the standard deviation of the points about the stems' surfaces (blur_of). Comments are
// written as in stem_constants.h. "Noisy clouds" are `treels/pine_plot` and the mobile and the
// flown cloud of `spanner`, each with 2 to 7 cm of noise added.
namespace understory::blur_constants {

// Stems that tell how blurred a cloud is, at least [chosen]
inline constexpr std::size_t kFewestForBlur = 3;
// m: blur of a cloud that is searched again, at least [tuned: with 2.8 cm the mobile cloud shows
// all its stems; simulated maps have 1.2 to 2.2 cm]
inline constexpr double kLeastBlur = 0.03;
// m: more counts as this [chosen]
inline constexpr double kMostBlur = 0.06;
// m: steps of a blur. The cells of a search in such clouds then fit the grid of all clouds [bound:
// kOriginStep]
inline constexpr double kBlurStep = 0.01;
// Rounds at most [chosen]
inline constexpr int kBlurRounds = 2;
// Radii of a stem that a thicker one covers [tuned on noisy clouds]
inline constexpr double kCoverRadii = 1.3;
// Returns of it, likewise [tuned on noisy clouds]
inline constexpr double kCoverReturns = 1.3;
// Blurs: radius of a stem at least; a thinner one is a column without an inside [chosen]
inline constexpr double kLeastRadiusBlurs = 2.0;

// Slices that one of the blurred cut holds [chosen]
inline constexpr double kBlurredSlices = 2.0;
// Blurs: distance of connected points there [chosen]
inline constexpr double kBlurredReach = 4.0;
// Blurs: half of the width of a circle's band there [chosen]
inline constexpr double kBlurredBand = 1.2;

// Blurs: scatter of a stem at most, in the first fit ... [chosen]
inline constexpr double kBlurredScatters = 1.5;
// ... and in the refined one [tuned on noisy clouds]
inline constexpr double kMostOfBlur = 1.75;
// Sum of the ratios of points inside and outside of the surface that a stem of few rings may have
// [tuned on noisy clouds]
inline constexpr double kBlurredClutter = 0.52;
// Radii: error of a stem's radius at most [tuned on noisy clouds: false ones had 0.33 and more]
inline constexpr double kBlurredSd = 0.28;
// Share of its directions that show a surface [tuned on noisy clouds]
inline constexpr double kBlurredFill = 0.7;
// degrees of its circle that are seen evenly [tuned on noisy clouds]
inline constexpr double kBlurredArcDeg = 150.0;
// Blurs: radius of a stem whose scatter is judged even if it stands clear [tuned on noisy clouds]
inline constexpr double kThickBlurs = 2.5;

// Blurs: scatter of points about a stem that a first fit takes, at most [chosen]
inline constexpr double kMostBlurs = 1.5;
// The same of a refined fit [bound: above kMostOfBlur]
inline constexpr double kMostRefinedBlurs = 2.0;
// Blurs from the surface: points that tell the scatter [chosen]
inline constexpr double kScatterBlurs = 2.5;
// Blurs from the surface: points that a fit takes [chosen]
inline constexpr double kReachBlurs = 4.0;

}  // namespace understory::blur_constants
