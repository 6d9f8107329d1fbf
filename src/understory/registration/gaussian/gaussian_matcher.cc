#include "understory/registration/gaussian/gaussian_matcher.h"

#include <algorithm>

#include "understory/registration/gaussian/staged_target.h"
#include "understory/registration/icp/icp_map_builder.h"

namespace understory {
namespace {

IcpMapConfig covariance_map(const GaussianIcpConfig& config) {
  IcpMapConfig map = config.map;
  map.planes = false;
  map.covariances = true;
  return map;
}

using Staged = internal::StagedTarget<GaussianIcpTarget>;

class GaussianIcpBuilder : public internal::IcpMapTargetBuilder {
 public:
  GaussianIcpBuilder(const GaussianIcpConfig& config, bool source_too)
      : IcpMapTargetBuilder(covariance_map(config)), config_(config), source_too_(source_too) {}

  [[nodiscard]] MatchTargetPtr snapshot() override {
    const IcpMapPtr points = map();
    const auto stage = [&](const GaussianIcpConfig& config) {
      return internal::GaussianStage<GaussianIcpTarget>{
          std::make_shared<GaussianIcpTarget>(points, config, source_too_), config.steps};
    };
    std::vector<internal::GaussianStage<GaussianIcpTarget>> stages;
    if (config_.far_distance_m > config_.max_distance_m) {
      GaussianIcpConfig far = config_;
      far.max_distance_m = config_.far_distance_m;
      far.steps.kernel_sigmas = std::max(config_.far_kernel_sigmas, config_.steps.kernel_sigmas);
      stages.push_back(stage(far));
    }
    stages.push_back(stage(config_));
    return std::make_shared<Staged>(std::move(stages), config_.max_distance_m, true);
  }

 private:
  GaussianIcpConfig config_;
  bool source_too_;
};

class GaussianIcpMatcher : public Matcher {
 public:
  GaussianIcpMatcher(const char* name, const GaussianIcpConfig& config, bool source_too)
      : config_(config), source_too_(source_too) {
    internal::check_reach({name, "max_distance_m", config.max_distance_m, config.far_distance_m},
                          config.map);
  }
  [[nodiscard]] std::unique_ptr<TargetBuilder> make_builder(const Viewpoint&) const override {
    return std::make_unique<GaussianIcpBuilder>(config_, source_too_);
  }
  [[nodiscard]] double reach_m() const override { return config_.max_distance_m; }
  [[nodiscard]] bool sums_up_points() const override { return true; }

 private:
  GaussianIcpConfig config_;
  bool source_too_;
};

void describe_gaussian_icp(ConfigTable& table, GaussianIcpConfig& config) {
  table.add("max_distance_m", config.max_distance_m, {0.05, 20.0}, "m",
            "farther neighbours are no match");
  describe(table, config.steps);
  internal::describe_far_distance(table, config.far_distance_m);
  table.add("far_kernel_sigmas", config.far_kernel_sigmas, {0.1, 1000.0}, "",
            "kernel_sigmas of those steps");
  internal::describe_map(table, "a target has one point per cube of this edge", config.map);
}

}  // namespace

GaussianSource GaussianIcpTarget::source_of(const Points& points) const {
  GaussianSource source{points, {}, {}};
  if (source_neighbours_ > 0) source.covariances = covariances_of(points, source_neighbours_);
  return source;
}

bool GaussianIcpTarget::pair(const GaussianSource& source, std::size_t i, const Eigen::Vector3d& at,
                             const Eigen::Matrix3d& rotation, Known& known,
                             GaussianPair& pair) const {
  IcpPair nearest;
  if (!map_->nearest(at, max_distance_m_, nearest, known.search)) return false;
  pair.offset = nearest.offset;
  const Eigen::Matrix3f* target = map_->covariance(known.search.spot);
  pair.tells = target != nullptr;
  if (!pair.tells) return true;
  const Eigen::Matrix3d noise = variance_ * Eigen::Matrix3d::Identity();
  if (!source.covariances.empty()) {
    const Eigen::Matrix3d own = source.covariances[i].cast<double>();
    pair.rows =
        three_planes(target->cast<double>() + rotation * own * rotation.transpose() + noise);
    return true;
  }
  pair.rows = three_planes(target->cast<double>() + noise);
  return true;
}

void describe(ConfigTable& table, PointToGaussianConfig& config) {
  describe_gaussian_icp(table, config.icp);
}

void describe(ConfigTable& table, GaussianToGaussianConfig& config) {
  describe_gaussian_icp(table, config.icp);
  table.add("source_neighbours", config.icp.source_neighbours, {4, 100}, "",
            "points from which the covariance of a source point is found");
}

std::unique_ptr<const Matcher> make_matcher(const PointToGaussianConfig& config) {
  return std::make_unique<GaussianIcpMatcher>(config.kName, config.icp, false);
}

std::unique_ptr<const Matcher> make_matcher(const GaussianToGaussianConfig& config) {
  return std::make_unique<GaussianIcpMatcher>(config.kName, config.icp, true);
}

std::vector<SuitedSetting> suited_settings(const PointToGaussianConfig&, const ScanTraits&) {
  return {};
}

std::vector<SuitedSetting> suited_settings(const GaussianToGaussianConfig&, const ScanTraits&) {
  return {};
}

}  // namespace understory
