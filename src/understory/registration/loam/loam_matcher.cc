#include "understory/registration/loam/loam_matcher.h"

#include <algorithm>
#include <array>
#include <optional>
#include <string>

#include "understory/geometry/symmetric_eigen.h"
#include "understory/registration/icp/icp_map_builder.h"
#include "understory/registration/judged_match.h"
#include "understory/registration/solve.h"

namespace understory {
namespace {

using Kinds = std::array<bool, 4>;  // which features count, by PointFeature
constexpr Kinds kAllKinds = {false, true, true, true};
constexpr Kinds kGroundAlone = {false, false, false, true};
constexpr Kinds kEdgesAlone = {false, true, false, false};

GaussianSource loam_source(const FeaturePoints& cloud, const Kinds& kinds) {
  GaussianSource source;
  for (std::size_t i = 0; i < cloud.features.size(); ++i) {
    if (!kinds[static_cast<std::size_t>(cloud.features[i])]) continue;
    source.means.push_back(cloud.points[i]);
    source.features.push_back(cloud.features[i]);
  }
  return source;
}

// The part of a pose that a step of LeGO-LOAM's method moves: axes of a right perturbation.
using Axes = Vector6d;
Axes axes_of(bool ground) {
  // Roll, pitch and height; or heading and place in the plane.
  return ground ? (Axes() << 1.0, 1.0, 0.0, 0.0, 0.0, 1.0).finished()
                : (Axes() << 0.0, 0.0, 1.0, 1.0, 1.0, 0.0).finished();
}

PoseCost restricted(const PoseCost& at, const Axes& axes) {
  return {at.cost, axes.cwiseProduct(at.gradient),
          axes.asDiagonal() * at.hessian * axes.asDiagonal()};
}

class LoamCost : public MatchCost {
 public:
  LoamCost(std::shared_ptr<const LoamTarget> target, GaussianSource source,
           const GaussianStepsConfig& steps)
      : target_(std::move(target)), source_(std::move(source)), steps_(steps) {}
  [[nodiscard]] PoseCost at(const Pose& target_from_source) const override {
    std::vector<LoamTarget::Known> known(source_.means.size());
    return internal::gaussian_cost(
        internal::gaussian_sums(*target_, source_, target_from_source, steps_, known), steps_);
  }
  [[nodiscard]] double step_translation_m() const override { return steps_.step_translation_m; }
  [[nodiscard]] double step_rotation_rad() const override { return steps_.step_rotation_rad; }

 private:
  std::shared_ptr<const LoamTarget> target_;
  GaussianSource source_;
  GaussianStepsConfig steps_;
};

struct LoamStage {
  std::shared_ptr<const LoamTarget> target;
  GaussianStepsConfig steps;
};

class LoamMatchTarget : public MatchTarget {
 public:
  // From wide to fine. `ground`: in two steps.
  LoamMatchTarget(std::vector<LoamStage> stages, const LoamConfig& config, bool ground)
      : stages_(std::move(stages)), config_(config), ground_(ground) {}

  [[nodiscard]] RegistrationResult match(const Points& source, const Pose& guess,
                                         const PoseTerms& terms, MatchStart start) const override {
    return match_features({source, {}}, guess, terms, start);
  }
  [[nodiscard]] RegistrationResult match_features(const FeaturePoints& source, const Pose& guess,
                                                  const PoseTerms& terms,
                                                  MatchStart start) const override {
    RegistrationResult result;
    result.target_from_source = guess;
    int iterations = 0;
    for (std::size_t i = start == MatchStart::kFar ? 0 : stages_.size() - 1; i < stages_.size();
         ++i) {
      const Pose from = result.target_from_source;
      result = ground_ ? in_two_steps(stages_[i], source, from, terms)
                       : at_once(stages_[i], source, from, terms);
      iterations += result.iterations;
      if (!result.usable()) break;
    }
    result.iterations = iterations;
    if (!result.usable()) result.target_from_source = guess;
    return result;
  }
  [[nodiscard]] double reach_m() const override { return config_.max_distance_m; }
  [[nodiscard]] std::size_t size() const override { return stages_.back().target->size(); }
  [[nodiscard]] std::unique_ptr<const MatchCost> cost(const Points& source,
                                                      MatchStart start) const override {
    return cost_of_features({source, {}}, start);
  }
  [[nodiscard]] std::unique_ptr<const MatchCost> cost_of_features(const FeaturePoints& source,
                                                                  MatchStart start) const override {
    const LoamStage& stage = start == MatchStart::kFar ? stages_.front() : stages_.back();
    return std::make_unique<LoamCost>(stage.target, loam_source(source, kAllKinds), stage.steps);
  }

 private:
  // Moves the pose by one kind of feature along its axes alone.
  static internal::Minimum one_step(const LoamStage& stage, const GaussianSource& source,
                                    const Pose& from, const PoseTerms& terms, bool ground) {
    const Axes axes = axes_of(ground);
    const GaussianStepsConfig& steps = stage.steps;
    std::vector<LoamTarget::Known> known(source.means.size());
    const auto evaluate = [&](const Pose& pose) {
      const MatchSums at = internal::gaussian_sums(*stage.target, source, pose, steps, known);
      PoseCost sum = internal::gaussian_cost(at, steps);
      internal::add_terms(terms, pose, steps.independent_share * static_cast<double>(at.matched),
                          sum);
      return restricted(sum, axes);
    };
    return internal::minimise(
        evaluate, from,
        {steps.max_iterations, steps.step_translation_m, steps.step_rotation_rad, steps.max_step_m,
         internal::mean_range(source.means)});
  }
  static RegistrationResult at_once(const LoamStage& stage, const FeaturePoints& cloud,
                                    const Pose& guess, const PoseTerms& terms) {
    return internal::gaussian_match(*stage.target, loam_source(cloud, kAllKinds), guess, terms,
                                    stage.steps);
  }
  // Ground, then edges, until a round moves the pose by less than a step that counts. From there
  // all features are matched at once, as LeGO-LOAM matches them to its map (section III.E).
  [[nodiscard]] RegistrationResult in_two_steps(const LoamStage& stage, const FeaturePoints& cloud,
                                                const Pose& guess, const PoseTerms& terms) const {
    const GaussianStepsConfig& steps = stage.steps;
    const GaussianSource ground = loam_source(cloud, kGroundAlone);
    const GaussianSource edges = loam_source(cloud, kEdgesAlone);
    Pose pose = guess;
    int iterations = 0;
    bool settled = false;
    for (int round = 0; round < config_.rounds && !settled; ++round) {
      const internal::Minimum low = one_step(stage, ground, pose, terms, true);
      const internal::Minimum level = one_step(stage, edges, low.pose, terms, false);
      const Vector6d moved = right_difference(level.pose, pose);
      pose = level.pose;
      iterations += low.iterations + level.iterations;
      settled = moved.tail<3>().norm() < kSettled * steps.step_translation_m &&
                moved.head<3>().norm() < kSettled * steps.step_rotation_rad;
    }
    RegistrationResult result = at_once(stage, cloud, pose, terms);
    result.iterations += iterations;
    return result;
  }

  static constexpr double kSettled = 5.0;  // steps
  std::vector<LoamStage> stages_;
  LoamConfig config_;
  bool ground_;
};

IcpMapConfig feature_map(const LoamConfig& config) {
  IcpMapConfig map = config.map;
  map.planes = false;
  map.covariances = true;
  return map;
}

// Edges, planes and, with `ground`, ground each have a map of their own.
class LoamTargetBuilder : public TargetBuilder {
 public:
  LoamTargetBuilder(const LoamConfig& config, bool ground)
      : config_(config),
        ground_(ground),
        edges_(feature_map(config)),
        planes_(feature_map(config)),
        ground_planes_(feature_map(config)) {}

  // Points without features make no map.
  void insert(const Points& points_in_source, const Pose& target_from_source,
              std::optional<double> forget_beyond_m) override {
    insert_features({points_in_source, {}}, target_from_source, forget_beyond_m);
  }
  void insert_features(const FeaturePoints& cloud, const Pose& target_from_source,
                       std::optional<double> forget_beyond_m) override {
    std::array<Points, kAllKinds.size()> kinds;
    for (std::size_t i = 0; i < cloud.features.size(); ++i)
      kinds[static_cast<std::size_t>(cloud.features[i])].push_back(cloud.points[i]);
    for (std::size_t kind = 0; kind < kinds.size(); ++kind) {
      const auto feature = static_cast<PointFeature>(kind);
      if (feature != PointFeature::kNone && !kinds[kind].empty())
        map_of(feature).insert(kinds[kind], target_from_source);
    }
    if (forget_beyond_m) forget_beyond(target_from_source.translation(), *forget_beyond_m);
  }
  void forget_beyond(const Eigen::Vector3d& centre, double radius_m) override {
    edges_.remove_beyond(centre, radius_m);
    planes_.remove_beyond(centre, radius_m);
    ground_planes_.remove_beyond(centre, radius_m);
  }
  void clear() override {
    edges_.clear();
    planes_.clear();
    ground_planes_.clear();
  }
  [[nodiscard]] double bytes() const override {
    return edges_.bytes() + planes_.bytes() + ground_planes_.bytes();
  }
  [[nodiscard]] MatchTargetPtr snapshot() override {
    LoamMaps maps{edges_.snapshot(), planes_.snapshot(), nullptr};
    maps.ground = ground_ ? ground_planes_.snapshot() : maps.planes;
    const auto stage = [&](const LoamConfig& config) {
      return LoamStage{std::make_shared<LoamTarget>(maps, config), config.steps};
    };
    std::vector<LoamStage> stages;
    if (config_.far_distance_m > config_.max_distance_m) {
      LoamConfig far = config_;
      far.max_distance_m = config_.far_distance_m;
      far.steps.kernel_sigmas = std::max(config_.far_kernel_sigmas, config_.steps.kernel_sigmas);
      stages.push_back(stage(far));
    }
    stages.push_back(stage(config_));
    return std::make_shared<LoamMatchTarget>(std::move(stages), config_, ground_);
  }

 private:
  IcpMapBuilder& map_of(PointFeature feature) {
    if (feature == PointFeature::kEdge) return edges_;
    return feature == PointFeature::kGround ? ground_planes_ : planes_;
  }

  LoamConfig config_;
  bool ground_;
  IcpMapBuilder edges_;
  IcpMapBuilder planes_;
  IcpMapBuilder ground_planes_;
};

class LoamMatcher : public Matcher {
 public:
  LoamMatcher(const char* name, const LoamConfig& config, bool ground)
      : config_(config),
        ground_(ground),
        finder_(std::make_shared<RingFeatureFinder>(config.features, ground)) {
    internal::check_reach({name, "max_distance_m", config.max_distance_m, config.far_distance_m},
                          config.map);
  }
  [[nodiscard]] std::unique_ptr<TargetBuilder> make_builder(const Viewpoint&) const override {
    return std::make_unique<LoamTargetBuilder>(config_, ground_);
  }
  [[nodiscard]] std::shared_ptr<const FeatureFinder> feature_finder() const override {
    return finder_;
  }
  [[nodiscard]] double reach_m() const override { return config_.max_distance_m; }
  [[nodiscard]] bool sums_up_points() const override { return true; }

 private:
  LoamConfig config_;
  bool ground_;
  std::shared_ptr<const FeatureFinder> finder_;
};

void describe_loam(ConfigTable& table, LoamConfig& config) {
  describe(table, config.features);
  table.add("max_distance_m", config.max_distance_m, {0.05, 20.0}, "m",
            "farther neighbours are no match");
  table.add("line_ratio", config.line_ratio, {1.0, 1000.0}, "",
            "largest over middle variance of edges that make a line, at least");
  table.add("plane_ratio", config.plane_ratio, {0.0, 1.0}, "",
            "smallest through middle variance of a plane, at most");
  describe(table, config.steps);
  internal::describe_far_distance(table, config.far_distance_m);
  table.add("far_kernel_sigmas", config.far_kernel_sigmas, {0.1, 1000.0}, "",
            "kernel_sigmas of those steps");
  internal::describe_map(table, "a map has one edge and one plane point per cube of this edge",
                         config.map);
}

// Rows of a line or of a plane through the surroundings of a point of the map; false: neither.
bool rows_of(const Eigen::Matrix3f& covariance, bool edge, const LoamConfig& config,
             Eigen::Matrix3d& rows) {
  const SymmetricEigen3 eigen = fast_symmetric_eigen(covariance.cast<double>());
  const double per_sigma = 1.0 / config.steps.sigma_m;
  rows.setZero();
  if (edge) {
    if (eigen.values[2] < config.line_ratio * eigen.values[1]) return false;
    rows.topRows<2>() = per_sigma * eigen.vectors.leftCols<2>().transpose();
    return true;
  }
  if (eigen.values[0] > config.plane_ratio * eigen.values[1]) return false;
  rows.row(0) = per_sigma * eigen.vectors.col(0).transpose();
  return true;
}

}  // namespace

bool LoamTarget::pair(const GaussianSource& source, std::size_t i, const Eigen::Vector3d& at,
                      const Eigen::Matrix3d& /*rotation*/, Known& known, GaussianPair& pair) const {
  const bool edge = source.features[i] == PointFeature::kEdge;
  const IcpMap& map = maps_.of(source.features[i]);
  IcpPair nearest;
  if (!map.nearest(at, config_.max_distance_m, nearest, known.search)) return false;
  if (known.of != known.search.spot) {
    known.of = known.search.spot;
    const Eigen::Matrix3f* covariance = map.covariance(known.of);
    known.tells = covariance != nullptr && rows_of(*covariance, edge, config_, known.rows);
  }
  pair.offset = nearest.offset;
  pair.tells = known.tells;
  pair.rows = known.rows;
  return true;
}

void describe(ConfigTable& table, LoamMatcherConfig& config) {
  describe_loam(table, config.loam);
}

void describe(ConfigTable& table, LoamGroundMatcherConfig& config) {
  describe_loam(table, config.loam);
  table.add("ground_slope_deg", config.loam.features.ground_slope_deg, {0.0, 60.0}, "deg",
            "steepest ground from one ring to the next");
  describe(table, config.loam.features.clusters);
  table.add("rounds", config.loam.rounds, {1, 50}, "",
            "times at most that ground and edges follow one another");
}

std::unique_ptr<const Matcher> make_matcher(const LoamMatcherConfig& config) {
  return std::make_unique<LoamMatcher>(config.kName, config.loam, false);
}

std::unique_ptr<const Matcher> make_matcher(const LoamGroundMatcherConfig& config) {
  return std::make_unique<LoamMatcher>(config.kName, config.loam, true);
}

std::vector<SuitedSetting> suited_settings(const LoamMatcherConfig&, const ScanTraits&) {
  return {};
}

std::vector<SuitedSetting> suited_settings(const LoamGroundMatcherConfig&, const ScanTraits&) {
  return {};
}

}  // namespace understory
