#pragma once

#include "understory/registration/matchers.h"

namespace understory {

// What all methods are set to where two clouds are matched, and not scans to a map. Of two clouds
// there is less in a cell than of the keyframes of a map, and the guess is the user's.
[[nodiscard]] inline MatcherConfig matchers_of_two_clouds() {
  MatcherConfig config;
  auto& ndt = config.get<NdtMatcherConfig>();
  ndt.cell_sizes_m = {3.0, 1.0};
  ndt.cells.sigma_floor_m = 0.03;
  config.get<IcpMatcherConfig>().far_distance_m = 0.0;
  return config;
}

// m: voxels that thin both clouds before. The target of a method that sums up its points keeps
// more.
inline constexpr double kTargetVoxelM = 0.1;
inline constexpr double kSourceVoxelM = 0.25;

}  // namespace understory
