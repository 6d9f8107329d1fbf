#pragma once

#include <memory>
#include <vector>

#include "understory/registration/gicp/gicp.h"
#include "understory/registration/icp/icp_map.h"
#include "understory/registration/matcher.h"
#include "understory/util/config/config.h"

namespace understory {

// Generalised ICP as a method of matchers.h. Targets are maps as ICP has them.
struct GicpMatcherConfig {
  static constexpr const char* kName = "gicp";
  static constexpr const char* kSummary = "nearest points, plane to plane";
  static constexpr FitnessNoise kFitnessNoise{0.015, 860.0};

  GicpConfig steps;
  IcpMapConfig map;
  // Where the guess may be far off, matching begins with these; 0: as it goes on.
  double far_distance_m = 1.0;
  double far_kernel_sigmas = 15.0;
};
void describe(ConfigTable& table, GicpMatcherConfig& config);
[[nodiscard]] std::unique_ptr<const Matcher> make_matcher(const GicpMatcherConfig& config);
[[nodiscard]] std::vector<SuitedSetting> suited_settings(const GicpMatcherConfig& config,
                                                         const ScanTraits& traits);

}  // namespace understory
