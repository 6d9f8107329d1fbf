#include "understory/registration/gicp/gicp.h"

#include <Eigen/LU>
#include <cmath>
#include <string>

#include "understory/registration/describe_steps.h"
#include "understory/registration/judged_match.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

class Accumulator {
 public:
  Accumulator(const IcpMap& target, const Points& source, const std::vector<SurfacePatch>& surfaces,
              const Pose& pose, const GicpConfig& config, std::vector<IcpMap::Known>& known)
      : target_(target),
        source_(source),
        known_(known),
        surfaces_(surfaces),
        pose_(pose),
        rotation_(pose.rotation_matrix()),
        config_(config),
        loss_(loss_of_step(source.size(), config.kernel_sigmas, config.loss,
                           [this](std::size_t i) { return squared_of(i); })),
        unmatched_(0.5 * loss_.of_unmatched(0.5 * config.max_distance_m * config.max_distance_m /
                                            (config.sigma_m * config.sigma_m))) {}

  void operator()(MatchSums& sums, std::size_t i) const {
    const Eigen::Vector3d point = source_[i].cast<double>();
    IcpPair pair;
    if (!target_.nearest(pose_ * point, config_.max_distance_m, pair, known_[i])) {
      sums.cost += unmatched_;
      return;
    }
    ++sums.matched;
    sums.nearest_squared += static_cast<double>(pair.squared_m2);
    const Eigen::Matrix3d information = information_of(pair, i);
    const Eigen::Vector3d pull = information * pair.offset;
    const double squared = pair.offset.dot(pull);
    const auto [loss, weight] = loss_.at(squared);
    Eigen::Matrix<double, 3, 6> jacobian;
    jacobian << -rotation_ * skew(point), rotation_;
    sums.cost += 0.5 * loss;
    sums.hessian += weight * jacobian.transpose() * information * jacobian;
    sums.gradient += weight * jacobian.transpose() * pull;
    sums.weight += weight;
    sums.weighted_residual += weight * squared;
    // Directions that the pair constrains: 1 of two planes, none of what has no surface.
    const double variance = 2.0 * config_.sigma_m * config_.sigma_m;
    sums.weighted_rows += weight * variance * information.trace();
    sums.surface_squared += weight * squared * variance;
  }

 private:
  // In the metric of both surfaces, m^-2.
  [[nodiscard]] Eigen::Matrix3d information_of(const IcpPair& pair, std::size_t i) const {
    const Eigen::Matrix3d covariance =
        surface_covariance(pair.patch, config_) +
        rotation_ * surface_covariance(surfaces_[i], config_) * rotation_.transpose();
    return covariance.inverse();
  }
  [[nodiscard]] double squared_of(std::size_t i) const {
    IcpPair pair;
    const Eigen::Vector3d at = pose_ * source_[i].cast<double>();
    if (!target_.nearest(at, config_.max_distance_m, pair, known_[i])) return std::nan("");
    return pair.offset.dot(information_of(pair, i) * pair.offset);
  }

  const IcpMap& target_;
  const Points& source_;
  std::vector<IcpMap::Known>& known_;  // each element belongs to one point
  const std::vector<SurfacePatch>& surfaces_;
  const Pose& pose_;
  Eigen::Matrix3d rotation_;
  const GicpConfig& config_;
  RobustLoss loss_;   // asks what stands above it
  double unmatched_;  // cost of a point without a match
};

}  // namespace

void describe(ConfigTable& table, GicpConfig& config) {
  table.add("max_distance_m", config.max_distance_m, {0.05, 20.0}, "m",
            "farther neighbours are no match");
  table.add("sigma_m", config.sigma_m, {0.001, 1.0}, "m", "noise of a point across its surface");
  table.add("along_sigma_m", config.along_sigma_m, {0.001, 100.0}, "m",
            "how far along its surface a point may lie from what it matches");
  table.add("kernel_sigmas", config.kernel_sigmas, {0.1, 100.0}, "",
            "scale of the kernel: matches much farther apart hardly count");
  describe(table, config.loss);
  table.add("source_neighbours", config.source_neighbours, {4, 100}, "",
            "points from which the surface of a source point is found");
  table.add("max_planarity", config.max_planarity, {0.0, 1.0}, "",
            "smallest through middle variance of a neighbourhood that still has a normal");
  internal::describe_steps(table, config);
}

Eigen::Matrix3d surface_covariance(const SurfacePatch& patch, const GicpConfig& config) {
  const double across = config.sigma_m * config.sigma_m;
  const double along = config.along_sigma_m * config.along_sigma_m;
  const Eigen::Vector3d direction = patch.direction.cast<double>();
  const Eigen::Matrix3d axis = direction * direction.transpose();
  switch (patch.surface) {
    case SurfaceKind::kPlane:
      return along * Eigen::Matrix3d::Identity() + (across - along) * axis;
    case SurfaceKind::kPole:
      return across * Eigen::Matrix3d::Identity() + (along - across) * axis;
    case SurfaceKind::kPoint:
      return across * Eigen::Matrix3d::Identity();
    case SurfaceKind::kNothing:
      break;
  }
  return along * Eigen::Matrix3d::Identity();
}

std::vector<SurfacePatch> source_surfaces(const Points& source, const GicpConfig& config) {
  return surfaces_of(source, config.source_neighbours, config.max_planarity);
}

MatchSums gicp_cost(const IcpMap& target, const Points& source,
                    const std::vector<SurfacePatch>& surfaces, const Pose& target_from_source,
                    const GicpConfig& config, std::vector<IcpMap::Known>& known) {
  const Accumulator accumulator(target, source, surfaces, target_from_source, config, known);
  return ordered_sum(source.size(), 64, MatchSums{}, accumulator);
}

RegistrationResult register_gicp(const IcpMap& target, const Points& source,
                                 const std::vector<SurfacePatch>& surfaces, const Pose& guess,
                                 const PoseTerms& terms, const GicpConfig& config) {
  const auto least = static_cast<std::size_t>(config.min_matches);
  if (target.size() < least || source.size() < least) {
    return internal::refused(RegistrationStatus::kTooFewPoints,
                             "only " + std::to_string(source.size()) + " source and " +
                                 std::to_string(target.size()) + " target points",
                             guess);
  }
  std::vector<IcpMap::Known> known(source.size());
  MatchSums at;
  Pose summed_at;
  const auto evaluate = [&](const Pose& pose) {
    at = gicp_cost(target, source, surfaces, pose, config, known);
    summed_at = pose;
    const double share = config.independent_share;
    PoseCost sum{share * at.cost, share * at.gradient, share * at.hessian};
    internal::add_terms(terms, pose, share * static_cast<double>(at.matched), sum);
    return sum;
  };
  const double range = internal::mean_range(source);
  const internal::Minimum minimum =
      internal::minimise(evaluate, guess,
                         {config.max_iterations, config.step_translation_m,
                          config.step_rotation_rad, config.max_step_m, range});
  if (summed_at.matrix() != minimum.pose.matrix())
    at = gicp_cost(target, source, surfaces, minimum.pose, config, known);
  return internal::judged_match(minimum, at, source, range, guess, internal::Judgement(config));
}

}  // namespace understory
