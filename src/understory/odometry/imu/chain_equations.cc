#include "understory/odometry/imu/chain_equations.h"

namespace understory {
namespace {

WhiteMotion whitened(const MotionResidual& residual, const Matrix9d& covariance,
                     const Eigen::Matrix<double, 3, 2>& gravity_by_tilt) {
  const Eigen::LLT<Matrix9d> root(covariance);
  return {root.matrixL().solve(residual.by_from), root.matrixL().solve(residual.by_to),
          root.matrixL().solve(residual.by_gravity * gravity_by_tilt),
          root.matrixL().solve(residual.error)};
}

}  // namespace

StateSolver::StateSolver(const Matrix15d& matrix) : factor_(matrix) {}

Vector15d StateSolver::solve(const Vector15d& right) const {
  return factor_.solve(right);
}

Matrix15d StateSolver::solve(const Matrix15d& right) const {
  return factor_.solve(right);
}

Matrix15x2 StateSolver::solve(const Matrix15x2& right) const {
  return factor_.solve(right);
}

Matrix15d StateSolver::inverse() const {
  return factor_.solve(Matrix15d::Identity());
}

ChainEquations::ChainEquations(std::size_t states)
    : diagonal(states, Matrix15d::Zero()),
      next(states, Matrix15d::Zero()),
      right(states, Vector15d::Zero()) {}

WhiteMotion ChainEquations::add_motion(std::size_t k, const ImuState& from, const ImuState& to,
                                       const Preintegration& motion, const Eigen::Vector3d& gravity,
                                       const Eigen::Matrix<double, 3, 2>& gravity_by_tilt,
                                       const ImuNoiseConfig& noise) {
  const WhiteMotion white =
      whitened(motion_residual(from, to, motion, gravity), motion.covariance, gravity_by_tilt);
  diagonal[k] += white.by_from.transpose() * white.by_from;
  next[k] += white.by_from.transpose() * white.by_to;
  diagonal[k + 1] += white.by_to.transpose() * white.by_to;
  right[k] -= white.by_from.transpose() * white.error;
  right[k + 1] -= white.by_to.transpose() * white.error;

  const double gyro = noise.gyro_bias_walk_rad_s2_sqrt_hz;
  const double accel = noise.accel_bias_walk_m_s3_sqrt_hz;
  Vector6d weight;
  weight << Eigen::Vector3d::Constant(1.0 / (gyro * gyro * motion.duration)),
      Eigen::Vector3d::Constant(1.0 / (accel * accel * motion.duration));
  Vector6d walk;
  walk << to.gyro_bias - from.gyro_bias, to.accel_bias - from.accel_bias;
  diagonal[k].diagonal().tail<6>() += weight;
  diagonal[k + 1].diagonal().tail<6>() += weight;
  next[k].diagonal().tail<6>() -= weight;
  right[k].tail<6>() += weight.cwiseProduct(walk);
  right[k + 1].tail<6>() -= weight.cwiseProduct(walk);
  return white;
}

StateSolver ChainEquations::eliminate(std::size_t k) {
  const StateSolver solver(diagonal[k]);
  diagonal[k + 1] -= next[k].transpose() * solver.solve(next[k]);
  right[k + 1] -= next[k].transpose() * solver.solve(right[k]);
  return solver;
}

}  // namespace understory
