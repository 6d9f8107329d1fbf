#include "understory/odometry/imu/imu_sums.h"

namespace understory {

Eigen::Vector3d mean_force(const std::vector<InertialSample>& samples) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double time = 0.0;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const double dt = to_seconds(samples[i].stamp - samples[i - 1].stamp);
    sum += 0.5 * dt * (samples[i].specific_force() + samples[i - 1].specific_force());
    time += dt;
  }
  return time > 0.0 ? Eigen::Vector3d(sum / time) : sum;
}

Eigen::Vector3d raw_turn(const std::vector<InertialSample>& samples) {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  for (std::size_t i = 1; i < samples.size(); ++i) {
    rotation =
        rotation * so3_exp(0.5 * (samples[i].angular_rate() + samples[i - 1].angular_rate()) *
                           to_seconds(samples[i].stamp - samples[i - 1].stamp));
  }
  return so3_log(rotation.normalized());
}

double turning(const std::vector<InertialSample>& samples) {
  double angle = 0.0;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    angle += 0.5 * (samples[i].angular_rate() + samples[i - 1].angular_rate()).norm() *
             to_seconds(samples[i].stamp - samples[i - 1].stamp);
  }
  return angle;
}

ImuState step_state(const ImuState& from, const InertialSample& a, const InertialSample& b,
                    const Eigen::Vector3d& gravity) {
  const double dt = to_seconds(b.stamp - a.stamp);
  const Eigen::Vector3d turn = (0.5 * (a.angular_rate() + b.angular_rate()) - from.gyro_bias) * dt;
  const Eigen::Quaterniond& begin = from.world_from_imu.rotation();
  const Eigen::Quaterniond end = begin * so3_exp(turn);
  const Eigen::Vector3d accel = 0.5 * (begin * (a.specific_force() - from.accel_bias) +
                                       end * (b.specific_force() - from.accel_bias)) +
                                gravity;
  ImuState to = from;
  to.stamp = b.stamp;
  to.world_from_imu =
      Pose(end, from.world_from_imu.translation() + from.velocity * dt + 0.5 * dt * dt * accel);
  to.velocity += accel * dt;
  return to;
}

}  // namespace understory
