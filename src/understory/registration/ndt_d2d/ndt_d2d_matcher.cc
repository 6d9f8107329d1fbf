#include "understory/registration/ndt_d2d/ndt_d2d_matcher.h"

#include "understory/registration/gaussian/voxel_matcher.h"

namespace understory {

// For internal::VoxelMatcher.
static const std::vector<double>& edges_of(const NdtD2dMatcherConfig& config) {
  return config.cell_sizes_m;
}
static GaussianVoxelsConfig grid_of(const NdtD2dMatcherConfig& config, double edge_m) {
  return {edge_m, config.min_points, false};
}
static GaussianSource target_cloud(const NdtD2dMatcherConfig&, const Points& points) {
  return {points, {}, {}};
}

GaussianSource NdtD2dTarget::source_of(const Points& points) const {
  GaussianVoxelsBuilder builder({voxel_m(), source_min_points_, false});
  builder.insert(points, {}, Pose());
  GaussianSource source;
  builder.snapshot()->for_each([&](const Eigen::Vector3d& mean, const GaussianVoxel& voxel) {
    if (!voxel.tells) return;
    source.means.emplace_back(mean.cast<float>());
    source.covariances.push_back(voxel.covariance);
  });
  return source;
}

void describe(ConfigTable& table, NdtD2dMatcherConfig& config) {
  table.add("cell_sizes_m", config.cell_sizes_m, "m", "cells of both clouds, coarse to fine");
  table.add("min_points", config.min_points, {4, 1000}, "",
            "fewest points of a cell of the target that has a distribution");
  table.add("source_min_points", config.source_min_points, {4, 1000}, "",
            "fewest points of a cell of the source that has a distribution");
  describe(table, config.steps);
}

std::unique_ptr<const Matcher> make_matcher(const NdtD2dMatcherConfig& config) {
  return std::make_unique<internal::VoxelMatcher<NdtD2dMatcherConfig, NdtD2dTarget>>(
      config, "cell_sizes_m");
}

std::vector<SuitedSetting> suited_settings(const NdtD2dMatcherConfig&, const ScanTraits&) {
  return {};
}

}  // namespace understory
