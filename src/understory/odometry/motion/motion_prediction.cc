#include "understory/odometry/motion/motion_prediction.h"

#include <Eigen/LU>
#include <algorithm>

#include "understory/odometry/imu/imu_sums.h"

namespace understory {
namespace {

constexpr double kPathStepS = 0.02;  // between poses where constant velocity stands in

}  // namespace

Preintegration coast(double duration_s, const Eigen::Vector3d& angular_rate,
                     const MotionConfig& config) {
  return constant_velocity_interval(duration_s, angular_rate, config.motion_accel_sigma_m_s2,
                                    config.motion_angular_accel_sigma_rad_s2);
}

NavState body_state(const MotionPrediction& prediction, const Pose& body_from_imu) {
  const ImuState& state = prediction.state;
  const Pose imu_from_body = body_from_imu.inverse();
  NavState nav;
  nav.stamp = state.stamp;
  nav.world_from_body = state.world_from_imu * imu_from_body;
  nav.velocity_in_world =
      state.velocity +
      state.world_from_imu.rotation() * prediction.angular_rate.cross(imu_from_body.translation());
  nav.gyro_bias = state.gyro_bias;
  nav.accel_bias = state.accel_bias;
  const Matrix6d adjoint = body_from_imu.adjoint();
  const Matrix6d covariance =
      adjoint * prediction.covariance.topLeftCorner<6, 6>() * adjoint.transpose();
  nav.pose_covariance = 0.5 * (covariance + covariance.transpose());
  return nav;
}

MotionPrediction MotionPredictor::advance(const MotionPrediction& from,
                                          const Preintegration& motion, TimeNs stamp) const {
  MotionPrediction to;
  to.state = predict_state(from.state, motion, stamp, gravity_);
  const MotionResidual r = motion_residual(from.state, to.state, motion, gravity_);
  const Matrix9d back = r.by_to.leftCols<9>().inverse();
  const Matrix9d transition = -back * r.by_from.leftCols<9>();
  to.covariance = transition * from.covariance * transition.transpose() +
                  back * motion.covariance * back.transpose();
  to.angular_rate = from.angular_rate;
  return to;
}

MotionPrediction MotionPredictor::predict(const MotionPrediction& from, TimeNs to) const {
  MotionPrediction at = from;
  if (buffer_ != nullptr && at.state.stamp < to) {
    const auto samples = buffer_->slice_available(at.state.stamp, to);
    if (samples.size() >= 2) {
      const ImuState& start = from.state;
      at = advance(from, preintegrate(samples, start.gyro_bias, start.accel_bias, config_.imu),
                   samples.back().stamp);
      at.angular_rate = samples.back().angular_rate() - start.gyro_bias;
    }
  }
  if (at.state.stamp < to)
    at = advance(at, coast(to_seconds(to - at.state.stamp), at.angular_rate, config_), to);
  return at;
}

std::vector<ImuState> MotionPredictor::path(
    const MotionPrediction& from, TimeNs to,
    const std::optional<Eigen::Vector3d>& fixed_velocity) const {
  std::vector<ImuState> path{from.state};
  ImuState& start = path.front();
  if (fixed_velocity) start.velocity = *fixed_velocity;
  ImuState at = start;
  Eigen::Vector3d angular_rate = from.angular_rate;
  std::vector<InertialSample> samples;
  if (buffer_ != nullptr) samples = buffer_->slice_available(at.stamp, to);
  for (std::size_t i = 1; i < samples.size(); ++i) {
    if (samples[i].stamp <= samples[i - 1].stamp) continue;
    ImuState next = step_state(at, samples[i - 1], samples[i], gravity_);
    if (fixed_velocity) {
      next.velocity = *fixed_velocity;
      next.world_from_imu = Pose(
          next.world_from_imu.rotation(),
          at.world_from_imu.translation() + *fixed_velocity * to_seconds(next.stamp - at.stamp));
    }
    at = next;
    angular_rate = samples[i].angular_rate() - at.gyro_bias;
    path.push_back(at);
  }
  while (at.stamp < to) {
    const TimeNs next = std::min(to, at.stamp + from_seconds(kPathStepS));
    const Preintegration motion = coast(to_seconds(next - at.stamp), angular_rate, config_);
    at = predict_state(at, motion, next, gravity_);
    path.push_back(at);
  }
  return path;
}

}  // namespace understory
