#pragma once

#include <cstdint>

#include "understory/registration/test_stand.h"

namespace understory::test {

// For tests of loops: a square stand on ground with waves of 0.4 m.
inline testing::Stand bumpy_stand(double half_width_m, double stems_per_hectare,
                                  std::uint64_t seed) {
  testing::StandOptions options;
  options.half_width_m = half_width_m;
  options.stems_per_hectare = stems_per_hectare;
  auto made = testing::make_stand(options, seed);
  made.bump_m = 0.4;
  return made;
}

}  // namespace understory::test
