#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "understory/forest/stems/beam_footprint.h"

namespace understory {

// A stem as one fit shows it, without any correction for the width of beams.
struct StemLook {
  double range_m = 0.0;  // mean over its points
  double radius_m = 0.0;
  double arc_deg = 0.0;
  double spread_m = 0.0;  // see StemFit
};

// The same stem from near and from afar.
struct StemSeenTwice {
  std::size_t stem = 0;
  StemLook near;
  StemLook far;
};

// How bright the bark of one stand is to its lidar. At 1 its data sheet is right, and bark reflects
// half of the light. Where bark is brighter, or the lidar tells weaker echoes, smaller parts of a
// beam still give an echo. Far stems come out thicker then.
struct BarkBrightness {
  static constexpr std::size_t kSteps = 13;
  double times = 1.0;  // that is expected
  // Of each multiple of `multiples`, sum 1: as it was believed beforehand, until stems tell.
  std::array<double, kSteps> chances{};
  int stems = 0;        // that were seen from near and from afar
  bool learnt = false;  // from them: there were enough

  // 1/4 to 16, each the square root of two times the one before.
  [[nodiscard]] static std::array<double, kSteps> multiples();
};

// With the right brightness stems are as thick from near as from afar in the mean. It is weighted
// by diameter_sd_m and robust (Student's t); each stem counts once. Its variance is that of single
// stems, which the pairs show, and 5 mm that all pairs of a run share. Beforehand the logarithm is
// 0, with a standard deviation of 1. Too few stems, or unknown beams: nothing is learnt, and
// `times` is 1.
[[nodiscard]] BarkBrightness learn_brightness(const BeamConfig& beams,
                                              const std::vector<StemSeenTwice>& seen);

// The footprint of beams on bark that is so many times as bright.
[[nodiscard]] BeamFootprint brightened(const BeamFootprint& beam, double times);

// How unsure excess_radius_m is as the brightness is, metres; 0 where nothing was learnt. `beam`:
// not brightened.
[[nodiscard]] double excess_sd_m(const BarkBrightness& bark, const BeamFootprint& beam,
                                 double radius_m, double arc_deg);

}  // namespace understory
