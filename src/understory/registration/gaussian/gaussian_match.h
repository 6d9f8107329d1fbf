#pragma once

#include <Eigen/Core>
#include <cmath>
#include <string>
#include <vector>

#include "understory/geometry/feature_points.h"
#include "understory/registration/describe_steps.h"
#include "understory/registration/judged_match.h"
#include "understory/registration/match_sums.h"
#include "understory/registration/registration.h"
#include "understory/registration/robust_loss.h"
#include "understory/registration/solve.h"
#include "understory/util/config/config.h"
#include "understory/util/parallel.h"

// What the methods have in common that match points or Gaussians to Gaussians.
namespace understory {

// The settings of their steps.
struct GaussianStepsConfig {
  double sigma_m = 0.03;       // noise of a point: added to every covariance
  double kernel_sigmas = 3.0;  // scale of the kernel
  RobustLossConfig loss;
  int max_iterations = 30;
  double max_step_m = 0.5;
  double step_translation_m = 1e-3;  // converged when a step is smaller than both
  double step_rotation_rad = 1e-4;
  double degenerate_ratio = 0.003;
  int min_matches = 50;
  double independent_share = 0.05;  // share of the points that counts as independent
};
void describe(ConfigTable& table, GaussianStepsConfig& config);

// The source of a match: means in its frame, and their covariances (m^2, axes of the source) if the
// method has any.
struct GaussianSource {
  Points means;
  std::vector<Eigen::Matrix3f> covariances;
  std::vector<PointFeature> features;  // of the means, for methods with features
};

// One pair at a pose.
struct GaussianPair {
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();  // of the source's mean from the target's
  Eigen::Matrix3d rows = Eigen::Matrix3d::Zero();    // e^T W^-1 e = |rows e|^2
  bool tells = true;                                 // false: matched, but it constrains nothing
};

// Three point-to-plane terms of a covariance W = N A N^T, P3 (4, 5): row i is n_i^T /
// sqrt(lambda_i), lambda ascending. W: symmetric, positive definite, m^2.
[[nodiscard]] Eigen::Matrix3d three_planes(const Eigen::Matrix3d& covariance);

namespace internal {

// Adds what one mean of the source says at a pose. `Target` has
//   struct Known;                             what it knows of a mean from the search before
//   static constexpr bool kExactGradient;     whether the covariance of the source turns along in
//                                             the gradient
//   bool pair(const GaussianSource&, std::size_t i, const Eigen::Vector3d& at,
//             const Eigen::Matrix3d& rotation, Known&, GaussianPair&) const;   `at`: placed mean
//   std::size_t size() const;
//   double most_squared() const;              largest squared residual of a pair
//   double noise_m2() const;                  variance of a pair across a perfect surface
template <typename Target>
class GaussianAccumulator {
 public:
  using Known = typename Target::Known;
  GaussianAccumulator(const Target& target, const GaussianSource& source, const Pose& pose,
                      const GaussianStepsConfig& config, std::vector<Known>& known)
      : target_(target),
        source_(source),
        known_(known),
        pose_(pose),
        rotation_(pose.rotation_matrix()),
        noise_m2_(target.noise_m2()),
        loss_(loss_of_step(source.means.size(), config.kernel_sigmas, config.loss,
                           [this](std::size_t i) { return squared_of(i); })),
        unmatched_(0.5 * loss_.of_unmatched(target.most_squared())) {}

  void operator()(MatchSums& sums, std::size_t i) const {
    const Eigen::Vector3d point = source_.means[i].template cast<double>();
    GaussianPair pair;
    if (!target_.pair(source_, i, pose_ * point, rotation_, known_[i], pair)) {
      sums.cost += unmatched_;
      return;
    }
    ++sums.matched;
    sums.nearest_squared += pair.offset.squaredNorm();
    if (!pair.tells) return;
    const Eigen::Vector3d residual = pair.rows * pair.offset;
    const double squared = residual.squaredNorm();
    const auto [loss, weight] = loss_.at(squared);
    sums.cost += 0.5 * loss;
    // Each row is a point-to-plane term of its own.
    const Eigen::Matrix3d in_source = pair.rows * rotation_;
    Eigen::Matrix<double, 3, 6> jacobian;
    jacobian << -in_source * skew(point), in_source;
    sums.hessian += weight * jacobian.transpose() * jacobian;
    sums.gradient += weight * jacobian.transpose() * residual;
    if constexpr (Target::kExactGradient) {
      const Eigen::Vector3d pull = in_source.transpose() * residual;
      const Eigen::Vector3d spread = source_.covariances[i].template cast<double>() * pull;
      sums.gradient.template head<3>() -= weight * spread.cross(pull);
    }
    sums.weight += weight;
    sums.weighted_residual += weight * squared;
    // Directions that the pair constrains: 1 of two planes, none of what has no surface.
    sums.weighted_rows += weight * noise_m2_ * pair.rows.squaredNorm();
    sums.surface_squared += weight * squared * noise_m2_;
  }

 private:
  [[nodiscard]] double squared_of(std::size_t i) const {
    GaussianPair pair;
    const Eigen::Vector3d at = pose_ * source_.means[i].template cast<double>();
    if (!target_.pair(source_, i, at, rotation_, known_[i], pair) || !pair.tells)
      return std::nan("");
    return (pair.rows * pair.offset).squaredNorm();
  }

  const Target& target_;
  const GaussianSource& source_;
  std::vector<Known>& known_;  // each element belongs to one mean
  const Pose& pose_;
  Eigen::Matrix3d rotation_;
  double noise_m2_;
  RobustLoss loss_;   // asks what stands above it
  double unmatched_;  // cost of a mean without a match
};

// The sums at a pose. Parallel; same bits for any number of threads.
template <typename Target>
[[nodiscard]] MatchSums gaussian_sums(const Target& target, const GaussianSource& source,
                                      const Pose& pose, const GaussianStepsConfig& config,
                                      std::vector<typename Target::Known>& known) {
  const GaussianAccumulator<Target> accumulator(target, source, pose, config, known);
  return ordered_sum(source.means.size(), 64, MatchSums{}, accumulator);
}

// The cost in the scale in which Gaussian terms can be added.
[[nodiscard]] inline PoseCost gaussian_cost(const MatchSums& at,
                                            const GaussianStepsConfig& config) {
  const double share = config.independent_share;
  return {share * at.cost, share * at.gradient, share * at.hessian};
}

// Matches a source to a target, Gauss-Newton steps from a guess: one linear system a step, no
// solver inside (P3 section 3.1).
template <typename Target>
[[nodiscard]] RegistrationResult gaussian_match(const Target& target, const GaussianSource& source,
                                                const Pose& guess, const PoseTerms& terms,
                                                const GaussianStepsConfig& config) {
  const auto least = static_cast<std::size_t>(config.min_matches);
  if (target.size() < least || source.means.size() < least) {
    return refused(RegistrationStatus::kTooFewPoints,
                   "only " + std::to_string(source.means.size()) + " source and " +
                       std::to_string(target.size()) + " target means",
                   guess);
  }
  std::vector<typename Target::Known> known(source.means.size());
  MatchSums at;
  Pose summed_at;
  const auto evaluate = [&](const Pose& pose) {
    at = gaussian_sums(target, source, pose, config, known);
    summed_at = pose;
    PoseCost sum = gaussian_cost(at, config);
    add_terms(terms, pose, config.independent_share * static_cast<double>(at.matched), sum);
    return sum;
  };
  const double range = mean_range(source.means);
  const Minimum minimum = minimise(evaluate, guess,
                                   {config.max_iterations, config.step_translation_m,
                                    config.step_rotation_rad, config.max_step_m, range});
  if (summed_at.matrix() != minimum.pose.matrix())
    at = gaussian_sums(target, source, minimum.pose, config, known);
  return judged_match(minimum, at, source.means, range, guess, Judgement(config));
}

}  // namespace internal
}  // namespace understory
