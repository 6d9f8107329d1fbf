#include "understory/simulation/inertial.h"

#include <cmath>
#include <numbers>

#include "understory/simulation/counter_noise.h"
#include "understory/simulation/scanner.h"

namespace understory {
namespace {

constexpr double kTau = 2.0 * std::numbers::pi;

Eigen::Vector3d normal3(CounterNoise& noise) {
  const double x = noise.normal();
  const double y = noise.normal();
  const double z = noise.normal();
  return {x, y, z};
}

Eigen::Matrix3d scale_matrix(double sd, CounterNoise& noise) {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  for (int i = 0; i < 3; ++i)
    matrix.row(i) += sd * normal3(noise).transpose();
  return matrix;
}

}  // namespace

double normal_gravity(double latitude_deg, double height_m) {
  const double s = std::pow(std::sin(latitude_deg * std::numbers::pi / 180.0), 2.0);
  return 9.7803253359 * (1.0 + 0.00193185265241 * s) / std::sqrt(1.0 - 0.00669437999014 * s) -
         3.086e-6 * height_m;
}

InertialSensor::InertialSensor(const SiteConfig& config, const CarrierPath& path, TimeNs start)
    : config_(config.imu),
      path_(path),
      start_(start),
      seed_(hash_numbers(static_cast<std::uint64_t>(config.seed), stream_of(NoiseStream::kImu))),
      gravity_(normal_gravity(config.origin.latitude_deg, config.origin.height_m)),
      body_from_imu_(mount_pose(config.imu.mount_m, config.imu.mount_rpy_deg)) {
  CounterNoise noise(seed_, 0, 1);
  gyro_scale_ = scale_matrix(config_.scale_sd, noise);
  accel_scale_ = scale_matrix(config_.scale_sd, noise);
  gyro_bias_ = config_.gyro_bias_sd * normal3(noise);
  accel_bias_ = config_.accel_bias_sd * normal3(noise);
}

TimeNs InertialSensor::next_stamp() const {
  return start_ +
         static_cast<TimeNs>(std::llround(static_cast<double>(count_) * 1e9 / config_.rate_hz));
}

void InertialSensor::walk_biases() {
  CounterNoise noise(seed_ + 1, static_cast<std::uint64_t>(count_), 0);
  const double root = 1.0 / std::sqrt(config_.rate_hz);
  gyro_bias_ += config_.gyro_bias_walk * root * normal3(noise);
  accel_bias_ += config_.accel_bias_walk * root * normal3(noise);
  ++count_;
}

void InertialSensor::skip() {
  walk_biases();
}

ImuSample InertialSensor::next() {
  ImuSample sample;
  sample.stamp = next_stamp();
  const double time = to_seconds(sample.stamp - start_);
  const CarrierState state = path_.state(time);
  const Eigen::Vector3d& arm = body_from_imu_.translation();
  const Eigen::Vector3d& omega = state.angular_rate;
  const Eigen::Quaterniond body_from_world = state.world_from_body.rotation().conjugate();
  const Eigen::Vector3d force_in_body =
      body_from_world * (state.acceleration + Eigen::Vector3d(0.0, 0.0, gravity_)) +
      state.angular_acceleration.cross(arm) + omega.cross(omega.cross(arm));
  const Eigen::Quaterniond imu_from_body = body_from_imu_.rotation().conjugate();

  CounterNoise noise(seed_ + 2, static_cast<std::uint64_t>(count_), 0);
  const double root = std::sqrt(config_.rate_hz);
  // Engine and hands shake the sensor faster than the path tells: a tone whose strength breathes.
  const double phase = kTau * config_.vibration_hz * time + 3.0 * std::sin(kTau * 0.37 * time);
  const double strength = config_.vibration_m_s2 * (1.0 + 0.5 * std::sin(kTau * 0.21 * time));
  const Eigen::Vector3d vibration =
      strength *
      Eigen::Vector3d(0.6 * std::sin(phase), 0.5 * std::sin(phase + 1.9), std::sin(phase + 0.7));
  sample.angular_rate = gyro_scale_ * (imu_from_body * omega) + gyro_bias_ +
                        config_.gyro_noise * root * normal3(noise);
  sample.specific_force = accel_scale_ * (imu_from_body * force_in_body) + accel_bias_ + vibration +
                          config_.accel_noise * root * normal3(noise);
  walk_biases();
  return sample;
}

}  // namespace understory
