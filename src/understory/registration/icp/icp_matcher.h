#pragma once

#include <memory>
#include <vector>

#include "understory/registration/icp/icp.h"
#include "understory/registration/icp/icp_map.h"
#include "understory/registration/matcher.h"
#include "understory/util/config/config.h"

namespace understory {

// ICP as a method of matchers.h. A single cloud is searched as it is (IcpTarget); clouds that come
// one after another make an IcpMap.
struct IcpMatcherConfig {
  static constexpr const char* kName = "icp";
  static constexpr const char* kSummary = "nearest points, to their planes";
  static constexpr FitnessNoise kFitnessNoise{0.014, 620.0};

  IcpConfig steps;
  IcpMapConfig map;
  double map_max_distance_m = 0.5;  // instead of steps.max_distance_m: a map has no gaps of its own
  // Where the guess may be far off, matching begins with these distances; 0: as it goes on.
  double far_distance_m = 1.0;
  double far_kernel_m = 0.5;
};
void describe(ConfigTable& table, IcpMatcherConfig& config);
[[nodiscard]] std::unique_ptr<const Matcher> make_matcher(const IcpMatcherConfig& config);
[[nodiscard]] std::vector<SuitedSetting> suited_settings(const IcpMatcherConfig& config,
                                                         const ScanTraits& traits);

}  // namespace understory
