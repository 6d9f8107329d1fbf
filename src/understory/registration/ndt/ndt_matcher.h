#pragma once

#include <memory>
#include <vector>

#include "understory/registration/matcher.h"
#include "understory/registration/ndt/ndt.h"
#include "understory/registration/ndt/ndt_map.h"
#include "understory/util/config/config.h"

namespace understory {

// NDT as a method of matchers.h: maps of one cell size each, coarse to fine.
struct NdtMatcherConfig {
  static constexpr const char* kName = "ndt";
  static constexpr const char* kSummary = "normal distributions in cells";
  static constexpr FitnessNoise kFitnessNoise{0.067, 34.0};

  std::vector<double> cell_sizes_m = {2.0, 0.5};  // edges, coarse to fine
  // Edge of the cells for points whose finest cell has too few points for a distribution; 0: such
  // points match nothing.
  double sparse_cell_m = 0.0;
  // cell_size_m is taken from the list above. Many keyframes lie in a cell: what they agree on is
  // sharper than one scan.
  NdtMapConfig cells = {.sigma_floor_m = 0.01};
  NdtConfig steps;
};
void describe(ConfigTable& table, NdtMatcherConfig& config);
[[nodiscard]] std::unique_ptr<const Matcher> make_matcher(const NdtMatcherConfig& config);
[[nodiscard]] std::vector<SuitedSetting> suited_settings(const NdtMatcherConfig& config,
                                                         const ScanTraits& traits);

}  // namespace understory
