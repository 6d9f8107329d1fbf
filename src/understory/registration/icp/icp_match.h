#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "understory/registration/icp/icp.h"
#include "understory/registration/icp/surface.h"
#include "understory/registration/judged_match.h"
#include "understory/registration/match_sums.h"
#include "understory/util/parallel.h"

// What all targets of ICP share, whatever they find nearest points by. A target T has
//   std::size_t size() const;
//   struct Known;  what it knows of a source point from the search before
//   bool nearest(const Eigen::Vector3d& at, double max_distance_m, IcpPair& pair, Known&) const;
namespace understory::internal {

// Adds what one source point says at a pose.
template <typename Target>
class IcpAccumulator {
 public:
  IcpAccumulator(const Target& target, const Points& source, const Pose& pose,
                 const IcpConfig& config, std::vector<typename Target::Known>& known)
      : target_(target),
        source_(source),
        known_(known),
        pose_(pose),
        rotation_(pose.rotation_matrix()),
        max_distance_m_(config.max_distance_m),
        precision_(1.0 / (config.sigma_m * config.sigma_m)),
        kernel_(config.kernel_m * config.kernel_m) {}

  void operator()(MatchSums& sums, std::size_t i) const {
    const Eigen::Vector3d point = source_[i].cast<double>();
    IcpPair pair;
    if (!target_.nearest(pose_ * point, max_distance_m_, pair, known_[i])) {
      sums.cost += 0.5 * kernel_ * precision_;  // as much as the worst match: leaving is no gain
      return;
    }
    ++sums.matched;
    sums.nearest_squared += static_cast<double>(pair.squared_m2);
    if (pair.patch.surface == SurfaceKind::kNothing) return;
    const Eigen::Vector3d direction = pair.patch.direction.cast<double>();
    Eigen::Matrix<double, 3, 6> jacobian;
    jacobian << -rotation_ * skew(point), rotation_;
    if (pair.patch.surface == SurfaceKind::kPlane) {
      add<1>(direction.transpose() * jacobian,
             Eigen::Matrix<double, 1, 1>(direction.dot(pair.offset)), sums);
    } else if (pair.patch.surface == SurfaceKind::kPole) {
      const Eigen::Matrix3d across =
          Eigen::Matrix3d::Identity() - direction * direction.transpose();
      add<3>(across * jacobian, across * pair.offset, sums);
    } else {
      add<3>(jacobian, pair.offset, sums);
    }
  }

 private:
  template <int Rows>
  void add(const Eigen::Matrix<double, Rows, 6>& jacobian,
           const Eigen::Matrix<double, Rows, 1>& residual, MatchSums& sums) const {
    const double squared = residual.squaredNorm();
    const double share = kernel_ / (kernel_ + squared);  // Geman-McClure
    const double weight = share * share;
    sums.cost += 0.5 * share * squared * precision_;
    sums.hessian += (weight * precision_) * jacobian.transpose() * jacobian;
    sums.gradient += (weight * precision_) * jacobian.transpose() * residual;
    sums.weight += weight;
    sums.weighted_residual += weight * squared * precision_;
    sums.weighted_rows += weight * Rows;
    sums.surface_squared += weight * squared;
  }

  const Target& target_;
  const Points& source_;
  std::vector<typename Target::Known>& known_;  // each element belongs to one point
  const Pose& pose_;
  Eigen::Matrix3d rotation_;
  double max_distance_m_;
  double precision_;
  double kernel_;
};

// Normal equations of all matches at a pose. `known` holds the partners of the pose before, by
// point.
template <typename Target>
[[nodiscard]] MatchSums icp_sums(const Target& target, const Points& source, const Pose& pose,
                                 const IcpConfig& config,
                                 std::vector<typename Target::Known>& known) {
  const IcpAccumulator<Target> accumulator(target, source, pose, config, known);
  return ordered_sum(source.size(), 64, MatchSums{}, accumulator);
}

// The cost in the scale in which Gaussian terms can be added.
[[nodiscard]] inline PoseCost icp_cost(const MatchSums& at, const IcpConfig& config) {
  const double share = config.independent_share;
  return {share * at.cost, share * at.gradient, share * at.hessian};
}

// Matches a source to a target, Gauss-Newton steps from a guess. The result tells why it ended.
template <typename Target>
[[nodiscard]] RegistrationResult icp_match(const Target& target, const Points& source,
                                           const Pose& guess, const PoseTerms& terms,
                                           const IcpConfig& config) {
  const auto least = static_cast<std::size_t>(config.min_matches);
  if (target.size() < least || source.size() < least) {
    return refused(RegistrationStatus::kTooFewPoints,
                   "only " + std::to_string(source.size()) + " source and " +
                       std::to_string(target.size()) + " target points",
                   guess);
  }
  std::vector<typename Target::Known> known(source.size());
  MatchSums at;
  const auto evaluate = [&](const Pose& pose) {
    at = icp_sums(target, source, pose, config, known);
    PoseCost sum = icp_cost(at, config);
    add_terms(terms, pose, sum);
    return sum;
  };
  const double range = mean_range(source);
  const Minimum minimum = minimise(evaluate, guess,
                                   {config.max_iterations, config.step_translation_m,
                                    config.step_rotation_rad, config.max_step_m, range});
  at = icp_sums(target, source, minimum.pose, config, known);
  return judged_match(minimum, at, source, range, guess, Judgement(config));
}

}  // namespace understory::internal
