#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "understory/registration/gaussian/gaussian_match.h"
#include "understory/registration/gaussian/voxel_target.h"
#include "understory/registration/gicp/gicp.h"
#include "understory/registration/matcher.h"
#include "understory/util/config/config.h"

namespace understory {

// Voxelised generalised ICP (Koide et al., Voxelized GICP for Fast and Accurate 3D Point Cloud
// Registration, 2021, (13)). A point meets the mean of the points of its voxel, without a search.
// The metric is that of its own surface and of the mean of theirs.
struct VgicpMatcherConfig {
  static constexpr const char* kName = "vgicp";
  static constexpr const char* kSummary = "GICP to voxels instead of points";
  static constexpr FitnessNoise kFitnessNoise{0.033, 170.0};

  static constexpr bool kSameSource = true;  // all grids see the source in the same way

  std::vector<double> voxel_sizes_m = {2.0, 0.5};  // coarse to fine
  bool faces = true;  // the nearest mean of the voxels beside, too; false: the own voxel alone
  double along_sigma_m = 1.0;  // see GicpConfig
  int neighbours = 12;         // from which the surface of a point is found
  double max_planarity = 0.1;  // see IcpConfig
  GaussianStepsConfig steps;
};
// See MatcherConfigs.
void describe(ConfigTable& table, VgicpMatcherConfig& config);
[[nodiscard]] std::unique_ptr<const Matcher> make_matcher(const VgicpMatcherConfig& config);
[[nodiscard]] std::vector<SuitedSetting> suited_settings(const VgicpMatcherConfig& config,
                                                         const ScanTraits& traits);

// One grid of it: see internal::GaussianAccumulator.
class VgicpTarget : public internal::VoxelTarget {
 public:
  static constexpr bool kExactGradient = false;  // as Koide et al.: the metric is that of the step

  VgicpTarget(GaussianVoxelsPtr voxels, const VgicpMatcherConfig& config)
      // Each surface has the noise of a point; they are two.
      : VoxelTarget(std::move(voxels), kLeastVariance,
                    2.0 * config.steps.sigma_m * config.steps.sigma_m, config.faces),
        config_(config) {}
  [[nodiscard]] GaussianSource source_of(const Points& points) const;

 private:
  static constexpr double kLeastVariance = 1e-8;  // m^2: surfaces have their own; keeps W regular
  VgicpMatcherConfig config_;
};

}  // namespace understory
