#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "understory/registration/gaussian/gaussian_match.h"
#include "understory/registration/gaussian/voxel_target.h"
#include "understory/registration/matcher.h"
#include "understory/util/config/config.h"

namespace understory {

// NDT from distribution to distribution (Stoyanov et al., Fast and accurate scan registration
// through minimization of the distance between compact 3D NDT representations, 2012, (5)). Source
// and target are grids of normal distributions, P4 (40), and each of the source meets the nearest
// of the target.
struct NdtD2dMatcherConfig {
  static constexpr const char* kName = "ndt_d2d";
  static constexpr const char* kSummary = "distributions to distributions";
  static constexpr FitnessNoise kFitnessNoise{0.105, 24.0};

  static constexpr bool kSameSource = false;  // each grid has cells of its own of the source

  std::vector<double> cell_sizes_m = {2.0, 1.0};  // coarse to fine
  int min_points = 5;         // fewest points of a cell of the target that has a distribution
  int source_min_points = 4;  // the same of the source
  GaussianStepsConfig steps;

  NdtD2dMatcherConfig() {
    steps.loss.kind = LossKind::kWelsch;  // the exponential of (5)
    steps.min_matches = 20;               // cells
    steps.independent_share = 1.0;        // cells do not share points
  }
};
// See MatcherConfigs.
void describe(ConfigTable& table, NdtD2dMatcherConfig& config);
[[nodiscard]] std::unique_ptr<const Matcher> make_matcher(const NdtD2dMatcherConfig& config);
[[nodiscard]] std::vector<SuitedSetting> suited_settings(const NdtD2dMatcherConfig& config,
                                                         const ScanTraits& traits);

// One grid of it: see internal::GaussianAccumulator.
class NdtD2dTarget : public internal::VoxelTarget {
 public:
  static constexpr bool kExactGradient = true;  // as (8) of Stoyanov et al.

  NdtD2dTarget(GaussianVoxelsPtr voxels, const NdtD2dMatcherConfig& config)
      : VoxelTarget(std::move(voxels), 2.0 * config.steps.sigma_m * config.steps.sigma_m,
                    2.0 * config.steps.sigma_m * config.steps.sigma_m, true),
        source_min_points_(config.source_min_points) {}
  [[nodiscard]] GaussianSource source_of(const Points& points) const;

 private:
  int source_min_points_;
};

}  // namespace understory
