#include "understory/odometry/imu/preintegration.h"

#include <algorithm>
#include <cmath>

#include "understory/odometry/odometry_constants.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using namespace odometry_constants::preintegration;

// One sampling interval of `dt` seconds, rates and forces free of bias at both ends.
struct Step {
  double dt;
  Eigen::Vector3d rate;         // mean of both ends
  Eigen::Vector3d force_begin;  // in the frame of the IMU at its own time
  Eigen::Vector3d force_end;
};

// The white noise of the accelerometer as its own samples show it, (m/s^2)^2/Hz, mean of the axes.
// It is that of second differences, in which the motion of a carrier is next to nothing. Where an
// engine or rotors shake the sensor faster than it samples, what they add looks like noise. Samples
// of a slow sensor, and those beside a gap, say nothing: there the motion itself would count. 0
// with too few others.
double shown_accel_noise(const std::vector<InertialSample>& samples) {
  double squares = 0.0;
  double duration_s = 0.0;
  int triples = 0;
  for (std::size_t i = 2; i < samples.size(); ++i) {
    const double before_s = to_seconds(samples[i - 1].stamp - samples[i - 2].stamp);
    const double after_s = to_seconds(samples[i].stamp - samples[i - 1].stamp);
    const auto [shorter, longer] = std::minmax(before_s, after_s);
    if (!(shorter > 0.0) || longer > kEvenSpacing * shorter || longer > kSlowestSpacingS) continue;
    squares += (samples[i - 2].specific_force() - 2.0 * samples[i - 1].specific_force() +
                samples[i].specific_force())
                   .squaredNorm();
    duration_s += 0.5 * (before_s + after_s);
    ++triples;
  }
  if (triples < kFewestTriples) return 0.0;
  // Of white noise the second difference has six times the variance.
  return squares / (18.0 * triples) * duration_s / triples;
}

void advance(Preintegration& sum, const Step& step, const ImuNoiseConfig& noise) {
  const double dt = step.dt;
  const Eigen::Vector3d turn = step.rate * dt;
  const Eigen::Quaterniond next = (sum.rotation * so3_exp(turn)).normalized();
  const Eigen::Matrix3d begin = sum.rotation.toRotationMatrix();
  const Eigen::Matrix3d end = next.toRotationMatrix();
  const Eigen::Matrix3d back = so3_exp(-turn).toRotationMatrix();
  const Eigen::Matrix3d right = so3_right_jacobian(turn);
  const Eigen::Vector3d accel = 0.5 * (begin * step.force_begin + end * step.force_end);
  // Mean acceleration by the rotation error before and after the step.
  const Eigen::Matrix3d by_begin = -0.5 * begin * skew(step.force_begin);
  const Eigen::Matrix3d by_end = -0.5 * end * skew(step.force_end);

  // Errors (rotation, velocity, position) after the step by those before it.
  Matrix9d transition = Matrix9d::Identity();
  transition.block<3, 3>(0, 0) = back;
  const Eigen::Matrix3d accel_by_rotation = by_begin + by_end * back;
  transition.block<3, 3>(3, 0) = accel_by_rotation * dt;
  transition.block<3, 3>(6, 0) = accel_by_rotation * (0.5 * dt * dt);
  transition.block<3, 3>(6, 3) = Eigen::Matrix3d::Identity() * dt;
  // By a constant error of the rate and of the force during the step.
  Eigen::Matrix<double, 9, 6> input = Eigen::Matrix<double, 9, 6>::Zero();
  const Eigen::Matrix3d mean_rotation = 0.5 * (begin + end);
  input.block<3, 3>(0, 0) = right * dt;
  input.block<3, 3>(3, 0) = by_end * right * (dt * dt);
  input.block<3, 3>(6, 0) = by_end * right * (0.5 * dt * dt * dt);
  input.block<3, 3>(3, 3) = mean_rotation * dt;
  input.block<3, 3>(6, 3) = mean_rotation * (0.5 * dt * dt);

  const double gyro = noise.gyro_noise_rad_s_sqrt_hz * noise.gyro_noise_rad_s_sqrt_hz / dt;
  const double force = noise.accel_noise_m_s2_sqrt_hz * noise.accel_noise_m_s2_sqrt_hz / dt;
  Vector6d density;
  density << gyro, gyro, gyro, force, force, force;
  sum.covariance = transition * sum.covariance * transition.transpose() +
                   input * density.asDiagonal() * input.transpose();
  sum.by_bias = transition * sum.by_bias - input;
  sum.position += sum.velocity * dt + 0.5 * dt * dt * accel;
  sum.velocity += accel * dt;
  sum.rotation = next;
  sum.duration += dt;
}

}  // namespace

Preintegration preintegrate(const std::vector<InertialSample>& samples,
                            const Eigen::Vector3d& gyro_bias, const Eigen::Vector3d& accel_bias,
                            const ImuNoiseConfig& noise) {
  UNDERSTORY_CHECK(samples.size() >= 2);
  Preintegration sum;
  sum.gyro_bias = gyro_bias;
  sum.accel_bias = accel_bias;
  ImuNoiseConfig shown = noise;
  shown.accel_noise_m_s2_sqrt_hz =
      std::max(noise.accel_noise_m_s2_sqrt_hz, std::sqrt(shown_accel_noise(samples)));
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const InertialSample& a = samples[i - 1];
    const InertialSample& b = samples[i];
    if (b.stamp <= a.stamp) continue;
    advance(sum,
            {to_seconds(b.stamp - a.stamp), 0.5 * (a.angular_rate() + b.angular_rate()) - gyro_bias,
             a.specific_force() - accel_bias, b.specific_force() - accel_bias},
            shown);
  }
  sum.covariance = 0.5 * (sum.covariance + sum.covariance.transpose()).eval();
  // Interpolation between samples is not exact: a floor of 0.001 deg, 1 mm/s and 0.1 mm keeps the
  // factor well-conditioned.
  Vector9d floor;
  floor << Eigen::Vector3d::Constant(3e-10), Eigen::Vector3d::Constant(1e-6),
      Eigen::Vector3d::Constant(1e-8);
  sum.covariance.diagonal() += floor;
  return sum;
}

Preintegration constant_velocity_interval(double duration, const Eigen::Vector3d& angular_rate,
                                          double accel_sigma, double angular_accel_sigma) {
  Preintegration motion;
  motion.gravity_weight = 0.0;
  motion.duration = duration;
  motion.rotation = so3_exp(angular_rate * duration);
  const double t = duration;
  const double accel = accel_sigma * accel_sigma;
  const double angular = angular_accel_sigma * angular_accel_sigma;
  const Eigen::Matrix3d unit = Eigen::Matrix3d::Identity();
  motion.covariance.block<3, 3>(0, 0) = unit * (angular * t * t * t / 3.0 + 1e-10);
  motion.covariance.block<3, 3>(3, 3) = unit * (accel * t + 1e-8);
  motion.covariance.block<3, 3>(3, 6) = unit * (accel * t * t / 2.0);
  motion.covariance.block<3, 3>(6, 3) = unit * (accel * t * t / 2.0);
  motion.covariance.block<3, 3>(6, 6) = unit * (accel * t * t * t / 3.0 + 1e-8);
  return motion;
}

ImuState predict_state(const ImuState& from, const Preintegration& motion, TimeNs stamp,
                       const Eigen::Vector3d& gravity) {
  Vector6d shift;
  shift << from.gyro_bias - motion.gyro_bias, from.accel_bias - motion.accel_bias;
  const Vector9d correction = motion.by_bias * shift;
  const double t = motion.duration;
  const Eigen::Vector3d g = gravity * motion.gravity_weight;
  const Eigen::Quaterniond& rotation = from.world_from_imu.rotation();
  ImuState to = from;
  to.stamp = stamp;
  to.velocity = from.velocity + g * t + rotation * (motion.velocity + correction.segment<3>(3));
  to.world_from_imu = Pose(rotation * motion.rotation * so3_exp(correction.segment<3>(0)),
                           from.world_from_imu.translation() + from.velocity * t + 0.5 * t * t * g +
                               rotation * (motion.position + correction.segment<3>(6)));
  return to;
}

MotionResidual motion_residual(const ImuState& from, const ImuState& to,
                               const Preintegration& motion, const Eigen::Vector3d& gravity) {
  Vector6d shift;
  shift << from.gyro_bias - motion.gyro_bias, from.accel_bias - motion.accel_bias;
  const Vector9d correction = motion.by_bias * shift;
  const double t = motion.duration;
  const double w = motion.gravity_weight;
  const Eigen::Quaterniond back = from.world_from_imu.rotation().conjugate();
  const Eigen::Matrix3d back_matrix = back.toRotationMatrix();

  const Eigen::Quaterniond relative = back * to.world_from_imu.rotation();
  const Eigen::Quaterniond predicted = motion.rotation * so3_exp(correction.segment<3>(0));
  const Eigen::Quaterniond difference = predicted.conjugate() * relative;
  const Eigen::Vector3d turn = so3_log(difference);
  const Eigen::Vector3d speed = back * (to.velocity - from.velocity - w * t * gravity);
  const Eigen::Vector3d way =
      back * (to.world_from_imu.translation() - from.world_from_imu.translation() -
              from.velocity * t - 0.5 * w * t * t * gravity);

  MotionResidual r;
  r.error << turn, speed - motion.velocity - correction.segment<3>(3),
      way - motion.position - correction.segment<3>(6);
  const Eigen::Matrix3d inverse = so3_right_jacobian_inverse(turn);
  r.by_from.setZero();
  r.by_from.block<3, 3>(0, 0) = -inverse * relative.conjugate().toRotationMatrix();
  r.by_from.block<3, 3>(0, 9) = -inverse * difference.conjugate().toRotationMatrix() *
                                so3_right_jacobian(correction.segment<3>(0)) *
                                motion.by_bias.block<3, 3>(0, 0);
  r.by_from.block<3, 3>(3, 0) = skew(speed);
  r.by_from.block<3, 3>(3, 6) = -back_matrix;
  r.by_from.block<6, 6>(3, 9) = -motion.by_bias.block<6, 6>(3, 0);
  r.by_from.block<3, 3>(6, 0) = skew(way);
  r.by_from.block<3, 3>(6, 3) = -Eigen::Matrix3d::Identity();
  r.by_from.block<3, 3>(6, 6) = -back_matrix * t;
  r.by_to.setZero();
  r.by_to.block<3, 3>(0, 0) = inverse;
  r.by_to.block<3, 3>(3, 6) = back_matrix;
  r.by_to.block<3, 3>(6, 3) = relative.toRotationMatrix();
  r.by_gravity << Eigen::Matrix3d::Zero(), -w * t * back_matrix, -0.5 * w * t * t * back_matrix;
  return r;
}

}  // namespace understory
