#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "understory/registration/gaussian/gaussian_voxels.h"
#include "understory/registration/gaussian/staged_target.h"
#include "understory/registration/matcher.h"
#include "understory/util/error.h"

// Matcher and builder of methods with grids of Gaussians, coarse to fine. `Config` has `kName`,
// `steps`; beside it stand, found by their argument:
//   const std::vector<double>& edges_of(const Config&);
//   GaussianVoxelsConfig grid_of(const Config&, double edge_m);
//   GaussianSource target_cloud(const Config&, const Points&);  what a cloud adds to the grids
namespace understory::internal {

// Puts clouds into one grid of each size.
template <typename Config, typename Target>
class VoxelTargetBuilder : public TargetBuilder {
 public:
  explicit VoxelTargetBuilder(const Config& config) : config_(config) {
    for (const double edge : edges_of(config))
      grids_.emplace_back(grid_of(config, edge));
  }

  void insert(const Points& points_in_source, const Pose& target_from_source,
              std::optional<double> forget_beyond_m) override {
    const GaussianSource cloud = target_cloud(config_, points_in_source);
    for (GaussianVoxelsBuilder& grid : grids_) {
      grid.insert(cloud.means, cloud.covariances, target_from_source);
      if (forget_beyond_m) grid.remove_beyond(target_from_source.translation(), *forget_beyond_m);
    }
  }
  void forget_beyond(const Eigen::Vector3d& centre, double radius_m) override {
    for (GaussianVoxelsBuilder& grid : grids_)
      grid.remove_beyond(centre, radius_m);
  }
  void clear() override {
    for (GaussianVoxelsBuilder& grid : grids_)
      grid.clear();
  }
  [[nodiscard]] double bytes() const override {
    double sum = 0.0;
    for (const GaussianVoxelsBuilder& grid : grids_)
      sum += grid.bytes();
    return sum;
  }
  [[nodiscard]] MatchTargetPtr snapshot() override {
    std::vector<GaussianStage<Target>> stages;
    for (GaussianVoxelsBuilder& grid : grids_)
      stages.push_back({std::make_shared<Target>(grid.snapshot(), config_), config_.steps});
    return std::make_shared<StagedTarget<Target>>(std::move(stages), edges_of(config_).back(),
                                                  Config::kSameSource);
  }

 private:
  Config config_;
  std::vector<GaussianVoxelsBuilder> grids_;
};

// The method; `edges_key` is the setting of the sizes.
template <typename Config, typename Target>
class VoxelMatcher : public Matcher {
 public:
  VoxelMatcher(const Config& config, const char* edges_key) : config_(config) {
    const std::string key = std::string(Config::kName) + "." + edges_key;
    if (edges_of(config).empty()) throw ConfigError({key + ": is empty"});
    for (const double edge : edges_of(config)) {
      if (!(edge >= 0.05 && edge <= 20.0))
        throw ConfigError({key + ": expected values within 0.05..20 m"});
    }
  }
  [[nodiscard]] std::unique_ptr<TargetBuilder> make_builder(const Viewpoint&) const override {
    return std::make_unique<VoxelTargetBuilder<Config, Target>>(config_);
  }
  [[nodiscard]] double reach_m() const override { return edges_of(config_).back(); }
  [[nodiscard]] bool sums_up_points() const override { return true; }

 private:
  Config config_;
};

}  // namespace understory::internal
