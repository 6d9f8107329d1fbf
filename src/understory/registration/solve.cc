#include "understory/registration/solve.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <variant>

#include "understory/registration/registration_constants.h"
#include "understory/util/parallel.h"

namespace understory::internal {
namespace {

using namespace registration_constants::solve;

// Units in which a step of 1 is one metre for rotations too.
Vector6d scale_of(double range_m) {
  Vector6d scale;
  scale << Eigen::Vector3d::Constant(1.0 / range_m), Eigen::Vector3d::Ones();
  return scale;
}

// Solves H step = -g in the basis of H's eigenvectors, so that indefinite and singular Hessians
// need no special case. Negative curvature changes its sign, and none gives no step.
Vector6d newton_step(const PoseCost& at, const Vector6d& scale) {
  const Matrix6d hessian = scale.asDiagonal() * at.hessian * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(hessian);
  const Vector6d curvature = solver.eigenvalues().cwiseAbs();
  const double strongest = curvature.maxCoeff();
  if (!(strongest > 0.0)) return Vector6d::Zero();
  Vector6d along = solver.eigenvectors().transpose() * scale.cwiseProduct(at.gradient);
  for (int i = 0; i < 6; ++i) {
    along[i] = curvature[i] < 1e-9 * strongest ? 0.0 : -along[i] / curvature[i];
  }
  return scale.cwiseProduct(solver.eigenvectors() * along);
}

void shorten(Vector6d& step, const StepLimits& limits) {
  const double length = std::max(step.tail<3>().norm(), limits.range_m * step.head<3>().norm());
  if (length > limits.max_step_m) step *= limits.max_step_m / length;
}

bool small(const Vector6d& step, const StepLimits& limits) {
  return step.tail<3>().norm() < limits.step_translation_m &&
         step.head<3>().norm() < limits.step_rotation_rad;
}

}  // namespace

Minimum minimise(const Evaluate& evaluate, const Pose& guess, const StepLimits& limits) {
  Minimum best{guess, evaluate(guess), 0, false};
  const Vector6d scale = scale_of(limits.range_m);
  double fraction = 1.0;
  while (best.iterations < limits.max_iterations) {
    Vector6d step = newton_step(best.at, scale);
    shorten(step, limits);
    step *= fraction;
    const Pose pose = best.pose * Pose::exp(step);
    ++best.iterations;
    if (limits.trust_last_step && small(step, limits)) {
      best.pose = pose;
      best.converged = true;
      break;
    }
    const PoseCost at = evaluate(pose);
    const double slope_before = best.at.gradient.dot(step);
    const double slope_after = at.gradient.dot(step);
    if (slope_after <= kMostOvershoot * std::abs(slope_before)) {
      best.pose = pose;
      best.at = at;
      fraction = std::min(1.0, 2.0 * fraction);
    } else {
      fraction *= 0.5;
    }
    // A step this small is the end whether it was taken or not: below it nothing is smooth.
    if (small(step, limits)) {
      best.converged = true;
      break;
    }
  }
  return best;
}

void add_term(const PosePrior& prior, const Pose& pose, PoseCost& to) {
  const Vector6d difference = right_difference(pose, prior.target_from_source);
  const Matrix6d jacobian = se3_right_jacobian_inverse(difference);
  const Matrix6d weighted = jacobian.transpose() * prior.information;
  to.cost += 0.5 * difference.dot(prior.information * difference);
  to.gradient += weighted * difference;
  to.hessian += weighted * jacobian;
}

void add_term(const PositionPrior& prior, const Pose& pose, PoseCost& to) {
  const Eigen::Matrix3d rotation = pose.rotation_matrix();
  const Eigen::Vector3d difference = pose * prior.point_in_source - prior.position_in_target;
  Eigen::Matrix<double, 3, 6> jacobian;
  jacobian << -rotation * skew(prior.point_in_source), rotation;
  const Eigen::Matrix<double, 6, 3> weighted = jacobian.transpose() * prior.information;
  to.cost += 0.5 * difference.dot(prior.information * difference);
  to.gradient += weighted * difference;
  to.hessian += weighted * jacobian;
}

void add_term(const PointPenalties& penalties, const Pose& pose, double points_weight,
              PoseCost& to) {
  const auto count = static_cast<double>(penalties.points.size());
  const double weight = points_weight / (penalties.scale * count);
  for (const PenaltyPoint& point : penalties.points) {
    add_term(PositionPrior{point.position_in_target, point.point_in_source,
                           weight * point.covariance.inverse()},
             pose, to);
  }
}

void add_terms(const PoseTerms& terms, const Pose& pose, double points_weight, PoseCost& to) {
  for (const PoseTerm& term : terms) {
    if (const auto* penalties = std::get_if<PointPenalties>(&term)) {
      add_term(*penalties, pose, points_weight, to);
    } else if (const auto* prior = std::get_if<PosePrior>(&term)) {
      add_term(*prior, pose, to);
    } else {
      add_term(std::get<PositionPrior>(term), pose, to);
    }
  }
}

Eigen::Matrix<double, 6, Eigen::Dynamic> degenerate_directions(const Matrix6d& information,
                                                               double range_m, double ratio) {
  const Vector6d scale = scale_of(range_m);
  const Matrix6d scaled = scale.asDiagonal() * information * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(scaled);
  const double limit = ratio * std::max(solver.eigenvalues()[5], 1e-12);
  Eigen::Index count = 0;
  while (count < 6 && solver.eigenvalues()[count] < limit)
    ++count;
  return solver.eigenvectors().leftCols(count);
}

double mean_range(const Points& points) {
  if (points.empty()) return 1.0;
  const double sum = ordered_sum(points.size(), 4096, 0.0, [&](double& total, std::size_t i) {
    total += static_cast<double>(points[i].norm());
  });
  return std::max(0.1, sum / static_cast<double>(points.size()));
}

}  // namespace understory::internal
