#include "understory/georeference/satellites/rigid_fits.h"

#include <algorithm>
#include <cmath>

#include "understory/geometry/best_rotation.h"
#include "understory/geometry/matrix_inverse.h"
#include "understory/geometry/symmetric_solver.h"
#include "understory/georeference/georeference_constants.h"
#include "understory/util/median.h"

namespace understory {
namespace {

using namespace georeference_constants::rigid_fits;

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Gauss-Newton over pairs with D residuals each; P4 (48-50).
template <int D>
struct Step {
  Matrix6d hessian = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();

  void add(const Eigen::Matrix<double, D, 1>& residual, const Eigen::Matrix<double, D, 6>& jacobian,
           const Eigen::Matrix<double, D, D>& information) {
    const Eigen::Matrix<double, 6, D> weighted = jacobian.transpose() * information;
    hessian += weighted * jacobian;
    gradient += weighted * residual;
  }
};

// Cauchy's weights of squared Mahalanobis distances; their scale is the median's.
void weigh(const std::vector<double>& squared, double expected_median,
           std::vector<double>& weight) {
  const double scale = std::max(1e-12, upper_median(squared) / expected_median);
  for (std::size_t k = 0; k < squared.size(); ++k)
    weight[k] = 1.0 / (1.0 + squared[k] / (scale * kCauchyWidth * kCauchyWidth));
}

// The loop that both iterated fits share. `Problem` gives the squared distances and the step.
template <typename Problem>
RigidFit iterate(const Problem& problem, std::size_t pairs, const Pose& start,
                 const RigidFitConfig& config) {
  RigidFit fit;
  fit.target_from_source = start;
  fit.weight.assign(pairs, 1.0);
  if (pairs < kFewestPairs) {
    fit.reason = "expected three pairs at least";
    return fit;
  }
  for (; fit.steps < config.most_steps; ++fit.steps) {
    if (config.robust) weigh(problem.squared(fit.target_from_source), Problem::kMedian, fit.weight);
    const auto step = problem.step(fit.target_from_source, fit.weight);
    const SymmetricSolver<6> solver(step.hessian);
    if (!solver.is_positive()) {
      fit.reason = "the pairs leave a direction open: expected a path that is not straight";
      return fit;
    }
    const Vector6d xi = -solver.solve(step.gradient);
    fit.target_from_source = fit.target_from_source * Pose::exp(xi);
    fit.covariance = solver.inverse();
    if (xi.norm() < config.least_step) break;
  }
  fit.found = true;
  return fit;
}

struct PositionProblem {
  static constexpr double kMedian = 2.366;  // of chi squared, three degrees of freedom
  const std::vector<PlacePair>& pairs;

  [[nodiscard]] Matrix3d information(const PlacePair& pair, const Matrix3d& r) const {
    return (pair.target_covariance + r * pair.source_covariance * r.transpose()).inverse();
  }
  [[nodiscard]] std::vector<double> squared(const Pose& motion) const {
    const Matrix3d r = motion.rotation_matrix();
    std::vector<double> result;
    for (const PlacePair& pair : pairs) {
      const Vector3d d = place_residual(pair, motion);
      result.push_back(d.dot(information(pair, r) * d));
    }
    return result;
  }
  [[nodiscard]] Step<3> step(const Pose& motion, const std::vector<double>& weight) const {
    const Matrix3d r = motion.rotation_matrix();
    Step<3> sum;
    for (std::size_t k = 0; k < pairs.size(); ++k)
      sum.add(place_residual(pairs[k], motion), place_residual_jacobian(pairs[k], motion),
              pairs[k].weight * weight[k] * information(pairs[k], r));
    return sum;
  }
};

struct PoseProblem {
  static constexpr double kMedian = 5.348;  // of chi squared, six degrees of freedom
  const std::vector<FullPair>& pairs;

  [[nodiscard]] static Matrix6d information(const FullPair& pair) {
    return inverse_matrix(pair.target_covariance + pair.source_covariance);
  }
  [[nodiscard]] std::vector<double> squared(const Pose& motion) const {
    std::vector<double> result;
    for (const FullPair& pair : pairs) {
      const Vector6d d = pose_residual(pair, motion);
      result.push_back(d.dot(information(pair) * d));
    }
    return result;
  }
  [[nodiscard]] Step<6> step(const Pose& motion, const std::vector<double>& weight) const {
    Step<6> sum;
    for (std::size_t k = 0; k < pairs.size(); ++k)
      sum.add(pose_residual(pairs[k], motion), pose_residual_jacobian(pairs[k], motion),
              pairs[k].weight * weight[k] * information(pairs[k]));
    return sum;
  }
};

}  // namespace

RigidFit fit_closed(const std::vector<PlacePair>& pairs) {
  RigidFit fit;
  if (pairs.size() < kFewestPairs) {
    fit.reason = "expected three pairs at least";
    return fit;
  }
  Vector3d source = Vector3d::Zero();
  Vector3d target = Vector3d::Zero();
  double total = 0.0;
  for (const PlacePair& pair : pairs) {
    source += pair.weight * pair.source;
    target += pair.weight * pair.target;
    total += pair.weight;
    fit.weight.push_back(pair.weight);
  }
  source /= total;
  target /= total;
  Matrix3d products = Matrix3d::Zero();
  double spread = 0.0;
  for (const PlacePair& pair : pairs) {
    products += pair.weight * (pair.target - target) * (pair.source - source).transpose();
    spread += pair.weight * (pair.source - source).squaredNorm();
  }
  if (spread / total < kLeastSpreadM * kLeastSpreadM) {
    fit.reason = "all positions lie at one place";
    return fit;
  }
  const Matrix3d rotation = best_rotation(products).rotation;
  fit.target_from_source = Pose(rotation, target - rotation * source);
  fit.found = true;
  return fit;
}

RigidFit fit_positions(const std::vector<PlacePair>& pairs, const Pose& start,
                       const RigidFitConfig& config) {
  return iterate(PositionProblem{pairs}, pairs.size(), start, config);
}

RigidFit fit_poses(const std::vector<FullPair>& pairs, const Pose& start,
                   const RigidFitConfig& config) {
  return iterate(PoseProblem{pairs}, pairs.size(), start, config);
}

Vector6d pose_residual(const FullPair& pair, const Pose& target_from_source) {
  return right_difference(pair.target_from_body, target_from_source * pair.source_from_body);
}

Matrix6d pose_residual_jacobian(const FullPair& pair, const Pose& target_from_source) {
  const Vector6d d = pose_residual(pair, target_from_source);
  // The left Jacobian's inverse at d is the right one's at -d.
  return -se3_right_jacobian_inverse(-d) * pair.source_from_body.inverse().adjoint();
}

Vector3d place_residual(const PlacePair& pair, const Pose& target_from_source) {
  return pair.target - target_from_source * pair.source;
}

Eigen::Matrix<double, 3, 6> place_residual_jacobian(const PlacePair& pair,
                                                    const Pose& target_from_source) {
  const Matrix3d r = target_from_source.rotation_matrix();
  Eigen::Matrix<double, 3, 6> jacobian;
  jacobian << r * skew(pair.source), -r;
  return jacobian;
}

}  // namespace understory
