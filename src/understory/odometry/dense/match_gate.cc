#include "understory/odometry/dense/match_gate.h"

#include <algorithm>
#include <cmath>

#include "understory/util/angles.h"

namespace understory {
GateVerdict judge_match(const MotionConfig& config, const ImuState& before,
                        const MotionPrediction& predicted, const ImuState& with_match,
                        const Pose& match, const Matrix6d& match_covariance) {
  const double dt = to_seconds(predicted.state.stamp - before.stamp);
  const bool previous = config.velocity_gate_reference == VelocityGateReference::kPreviousState;
  const Eigen::Vector3d& reference = previous ? before.velocity : predicted.state.velocity;
  GateVerdict verdict;
  verdict.velocity_jump_m_s = (with_match.velocity - reference).norm();
  // What the prediction itself does not know opens the gate, and what the match does not know.
  const auto sigma = [&](int at) {
    return std::sqrt(predicted.covariance.diagonal().segment<3>(at).maxCoeff());
  };
  const auto match_sigma = [&](int at) {
    return std::sqrt(match_covariance.diagonal().segment<3>(at).maxCoeff());
  };
  const bool gated = config.velocity_gate_m_s > 0.0;
  if (gated && verdict.velocity_jump_m_s > std::hypot(config.velocity_gate_m_s, 3.0 * sigma(6))) {
    verdict.reason = "the match would change the velocity by " +
                     std::to_string(verdict.velocity_jump_m_s) + " m/s";
    return verdict;
  }
  if (previous) return verdict;
  // A stiff prediction hides a wrong match from the velocity, so the way is looked at, too.
  const Pose& expected = predicted.state.world_from_imu;
  const double way = (match.translation() - expected.translation()).norm();
  if (gated &&
      way > std::hypot(config.velocity_gate_m_s * dt, 3.0 * sigma(3), 3.0 * match_sigma(3))) {
    verdict.velocity_jump_m_s = std::max(verdict.velocity_jump_m_s, way / dt);
    verdict.reason = "the match is " + std::to_string(way) + " m from the prediction";
    return verdict;
  }
  const double turn = (expected.inverse() * match).angle();
  if (config.angular_gate_deg_s > 0.0 && turn > std::hypot(config.angular_gate_deg_s * kDegree * dt,
                                                           3.0 * sigma(0), 3.0 * match_sigma(0)))
    verdict.reason = "the match is turned by " + std::to_string(turn / kDegree) +
                     " degrees against the prediction";
  return verdict;
}

}  // namespace understory
