#include "understory/registration/icp/icp_matcher.h"

#include <algorithm>
#include <utility>

#include "understory/registration/icp/icp_map_builder.h"
#include "understory/registration/icp/icp_match.h"

namespace understory {
namespace {

// The distances with which matching begins where the guess may be far off.
IcpConfig far_steps(const IcpConfig& steps, const IcpMatcherConfig& config) {
  IcpConfig far = steps;
  far.max_distance_m = std::max(config.far_distance_m, steps.max_distance_m);
  far.kernel_m = std::max(config.far_kernel_m, steps.kernel_m);
  return far;
}

IcpMapConfig map_config(const IcpMatcherConfig& config) {
  IcpMapConfig map = config.map;
  map.planes = has_planes(config.steps);
  map.max_planarity = config.steps.max_planarity;
  return map;
}

// `Target` as in icp_match.h.
template <typename Target>
class IcpCost : public MatchCost {
 public:
  IcpCost(const Target& target, const Points& source, const IcpConfig& steps)
      : target_(target),
        source_(source),
        steps_(steps),
        surfaces_(internal::icp_source_surfaces(source, steps)) {}
  [[nodiscard]] PoseCost at(const Pose& target_from_source) const override {
    std::vector<typename Target::Known> known(source_.size());
    return internal::icp_cost(
        internal::icp_sums(target_, source_, target_from_source, steps_, surfaces_, known), steps_);
  }
  [[nodiscard]] double step_translation_m() const override { return steps_.step_translation_m; }
  [[nodiscard]] double step_rotation_rad() const override { return steps_.step_rotation_rad; }

 private:
  const Target& target_;
  const Points& source_;
  IcpConfig steps_;
  std::vector<SurfacePatch> surfaces_;
};

template <typename Target>
class IcpMatchTarget : public MatchTarget {
 public:
  IcpMatchTarget(std::shared_ptr<const Target> target, const IcpConfig& steps,
                 const IcpMatcherConfig& config)
      : target_(std::move(target)),
        has_far_(config.far_distance_m > steps.max_distance_m),
        near_steps_(steps),
        far_steps_(far_steps(steps, config)) {}

  [[nodiscard]] RegistrationResult match(const Points& source, const Pose& guess,
                                         const PoseTerms& terms, MatchStart start) const override {
    if (start == MatchStart::kNear || !has_far_)
      return internal::icp_match(*target_, source, guess, terms, near_steps_);
    const RegistrationResult far = internal::icp_match(*target_, source, guess, terms, far_steps_);
    if (!far.usable()) return far;
    RegistrationResult result =
        internal::icp_match(*target_, source, far.target_from_source, terms, near_steps_);
    result.iterations += far.iterations;
    if (!result.usable()) result.target_from_source = guess;
    return result;
  }
  [[nodiscard]] double reach_m() const override { return near_steps_.max_distance_m; }
  [[nodiscard]] std::size_t size() const override { return target_->size(); }
  [[nodiscard]] std::unique_ptr<const MatchCost> cost(const Points& source,
                                                      MatchStart start) const override {
    return std::make_unique<IcpCost<Target>>(*target_, source,
                                             start == MatchStart::kFar ? far_steps_ : near_steps_);
  }

 private:
  std::shared_ptr<const Target> target_;
  bool has_far_;
  IcpConfig near_steps_;
  IcpConfig far_steps_;
};

class IcpTargetBuilder : public internal::IcpMapTargetBuilder {
 public:
  explicit IcpTargetBuilder(const IcpMatcherConfig& config)
      : IcpMapTargetBuilder(map_config(config)), config_(config), steps_(config.steps) {
    steps_.max_distance_m = config.map_max_distance_m;
  }

  [[nodiscard]] MatchTargetPtr snapshot() override {
    return std::make_shared<IcpMatchTarget<IcpMap>>(map(), steps_, config_);
  }

 private:
  IcpMatcherConfig config_;
  IcpConfig steps_;
};

class IcpMatcher : public Matcher {
 public:
  explicit IcpMatcher(const IcpMatcherConfig& config) : config_(config) {
    config_.steps = settled(config.steps);
  }

  [[nodiscard]] std::unique_ptr<TargetBuilder> make_builder(const Viewpoint&) const override {
    internal::check_reach(
        {"icp", "map_max_distance_m", config_.map_max_distance_m, config_.far_distance_m},
        config_.map);
    return std::make_unique<IcpTargetBuilder>(config_);
  }
  [[nodiscard]] MatchTargetPtr make_target(const Points& points) const override {
    return std::make_shared<IcpMatchTarget<IcpTarget>>(
        std::make_shared<IcpTarget>(points, config_.steps), config_.steps, config_);
  }
  [[nodiscard]] double reach_m() const override { return config_.map_max_distance_m; }
  [[nodiscard]] bool sums_up_points() const override { return false; }

 private:
  IcpMatcherConfig config_;
};

}  // namespace

void describe(ConfigTable& table, IcpMatcherConfig& config) {
  describe(table, config.steps);
  internal::describe_far_distance(table, config.far_distance_m);
  table.add("far_kernel_m", config.far_kernel_m, {0.005, 10.0}, "m", "kernel_m of those steps");
  internal::describe_map(table, "a map of keyframes has one point per cube of this edge",
                         config.map);
  table.add("map_max_distance_m", config.map_max_distance_m, {0.05, 20.0}, "m",
            "max_distance_m in a map of keyframes");
}

std::unique_ptr<const Matcher> make_matcher(const IcpMatcherConfig& config) {
  return std::make_unique<IcpMatcher>(config);
}

std::vector<SuitedSetting> suited_settings(const IcpMatcherConfig&, const ScanTraits&) {
  return {};
}

}  // namespace understory
