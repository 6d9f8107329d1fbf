#include "understory/registration/gicp/gicp_matcher.h"
#include "understory/registration/icp/icp_map_builder.h"
#include "understory/registration/wide_steps.h"

#include <algorithm>
#include <utility>
#include <vector>

namespace understory {
namespace {

class GicpMatchCost : public MatchCost {
 public:
  GicpMatchCost(const IcpMap& target, const Points& source, const GicpConfig& steps)
      : target_(target),
        source_(source),
        steps_(steps),
        surfaces_(source_surfaces(source, steps)) {}
  [[nodiscard]] PoseCost at(const Pose& target_from_source) const override {
    std::vector<IcpMap::Known> known(source_.size());
    const MatchSums sums =
        gicp_cost(target_, source_, surfaces_, target_from_source, steps_, known);
    const double share = steps_.independent_share;
    return {share * sums.cost, share * sums.gradient, share * sums.hessian};
  }
  [[nodiscard]] double step_translation_m() const override { return steps_.step_translation_m; }
  [[nodiscard]] double step_rotation_rad() const override { return steps_.step_rotation_rad; }

 private:
  const IcpMap& target_;
  const Points& source_;
  GicpConfig steps_;
  std::vector<SurfacePatch> surfaces_;
};

class GicpTarget : public MatchTarget {
 public:
  GicpTarget(IcpMapPtr map, const GicpMatcherConfig& config)
      : map_(std::move(map)), near_(config.steps), far_(config.steps) {
    far_.max_distance_m = std::max(config.far_distance_m, near_.max_distance_m);
    far_.kernel_sigmas = std::max(config.far_kernel_sigmas, near_.kernel_sigmas);
  }

  [[nodiscard]] RegistrationResult match(const Points& source, const Pose& guess,
                                         const PoseTerms& terms, MatchStart start) const override {
    const std::vector<SurfacePatch> surfaces = source_surfaces(source, near_);
    if (start == MatchStart::kNear || far_.max_distance_m <= near_.max_distance_m)
      return register_gicp(*map_, source, surfaces, guess, terms, near_);
    const RegistrationResult far =
        register_gicp(*map_, internal::wide_part(source), internal::wide_part(surfaces), guess,
                      terms, internal::wide_steps(far_));
    if (!far.usable()) return far;
    RegistrationResult result =
        register_gicp(*map_, source, surfaces, far.target_from_source, terms, near_);
    result.iterations += far.iterations;
    if (!result.usable()) result.target_from_source = guess;
    return result;
  }
  [[nodiscard]] double reach_m() const override { return near_.max_distance_m; }
  [[nodiscard]] std::size_t size() const override { return map_->size(); }
  [[nodiscard]] std::unique_ptr<const MatchCost> cost(const Points& source,
                                                      MatchStart start) const override {
    return std::make_unique<GicpMatchCost>(*map_, source, start == MatchStart::kFar ? far_ : near_);
  }

 private:
  IcpMapPtr map_;
  GicpConfig near_;
  GicpConfig far_;
};

IcpMapConfig map_config(const GicpMatcherConfig& config) {
  IcpMapConfig map = config.map;
  map.max_planarity = config.steps.max_planarity;
  return map;
}

class GicpTargetBuilder : public internal::IcpMapTargetBuilder {
 public:
  explicit GicpTargetBuilder(const GicpMatcherConfig& config)
      : IcpMapTargetBuilder(map_config(config)), config_(config) {}

  [[nodiscard]] MatchTargetPtr snapshot() override {
    return std::make_shared<GicpTarget>(map(), config_);
  }

 private:
  GicpMatcherConfig config_;
};

class GicpMatcher : public Matcher {
 public:
  explicit GicpMatcher(const GicpMatcherConfig& config) : config_(config) {
    internal::check_reach(
        {"gicp", "max_distance_m", config.steps.max_distance_m, config.far_distance_m}, config.map);
  }
  [[nodiscard]] std::unique_ptr<TargetBuilder> make_builder(const Viewpoint&) const override {
    return std::make_unique<GicpTargetBuilder>(config_);
  }
  [[nodiscard]] double reach_m() const override { return config_.steps.max_distance_m; }
  [[nodiscard]] bool sums_up_points() const override { return true; }

 private:
  GicpMatcherConfig config_;
};

}  // namespace

void describe(ConfigTable& table, GicpMatcherConfig& config) {
  describe(table, config.steps);
  internal::describe_far_distance(table, config.far_distance_m);
  table.add("far_kernel_sigmas", config.far_kernel_sigmas, {0.1, 1000.0}, "",
            "kernel_sigmas of those steps");
  internal::describe_map(table, "a target has one point per cube of this edge", config.map);
}

std::unique_ptr<const Matcher> make_matcher(const GicpMatcherConfig& config) {
  return std::make_unique<GicpMatcher>(config);
}

std::vector<SuitedSetting> suited_settings(const GicpMatcherConfig&, const ScanTraits&) {
  return {};
}

}  // namespace understory
