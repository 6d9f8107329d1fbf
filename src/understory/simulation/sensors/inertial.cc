#include "understory/simulation/sensors/inertial.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "understory/simulation/sensors/counter_noise.h"
#include "understory/simulation/sensors/scanner.h"
#include "understory/util/angles.h"

namespace understory {
namespace {

// Time constants of the parts of the bias instability, and the standard deviation of each for an
// instability of 1. Together they give an Allan deviation of 0.664 (within 3 % from 3 to 300 s).
constexpr double kFlickerSeconds[] = {2.0, 20.0, 200.0, 2000.0};
constexpr double kFlickerShare = 0.882;

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

InertialSensor::InertialSensor(const SiteConfig& config, const CarrierPath& path, TimeNs start,
                               std::vector<double> shocks_s)
    : config_(config.imu),
      path_(path),
      start_(start),
      seed_(hash_numbers(static_cast<std::uint64_t>(config.seed), stream_of(NoiseStream::kImu))),
      gravity_(normal_gravity(config.origin.latitude_deg, config.origin.height_m)),
      body_from_imu_(mount_pose(config.imu.mount_m, config.imu.mount_rpy_deg)),
      drifts_(config.imu.gyro_instability > 0.0 || config.imu.accel_instability > 0.0 ||
              config.imu.warm_up_k > 0.0),
      shocks_s_(std::move(shocks_s)) {
  CounterNoise noise(seed_, 0, 1);
  gyro_scale_ = scale_matrix(config_.scale_sd, noise);
  accel_scale_ = scale_matrix(config_.scale_sd, noise);
  gyro_bias_ = config_.gyro_bias_sd * normal3(noise);
  accel_bias_ = config_.accel_bias_sd * normal3(noise);
  wander_ << gyro_bias_, accel_bias_;
  CounterNoise later(seed_, 0, 2);
  for (int i = 0; i < kFlickers; ++i) {
    flicker_.col(i).head<3>() = normal3(later);
    flicker_.col(i).tail<3>() = normal3(later);
  }
  per_kelvin_.head<3>() = config_.gyro_temperature * normal3(later);
  per_kelvin_.tail<3>() = config_.accel_temperature * normal3(later);
  if (drifts_) drift();
}

TimeNs InertialSensor::next_stamp() const {
  return start_ +
         static_cast<TimeNs>(std::llround(static_cast<double>(count_) * 1e9 / config_.rate_hz));
}

void InertialSensor::walk_biases() {
  CounterNoise noise(seed_ + 1, static_cast<std::uint64_t>(count_), 0);
  const double root = 1.0 / std::sqrt(config_.rate_hz);
  if (!drifts_) {
    gyro_bias_ += config_.gyro_bias_walk * root * normal3(noise);
    accel_bias_ += config_.accel_bias_walk * root * normal3(noise);
    ++count_;
    return;
  }
  wander_.head<3>() += config_.gyro_bias_walk * root * normal3(noise);
  wander_.tail<3>() += config_.accel_bias_walk * root * normal3(noise);
  ++count_;
  for (int i = 0; i < kFlickers; ++i) {
    const double keep = std::exp(-1.0 / (config_.rate_hz * kFlickerSeconds[i]));
    const double fresh = std::sqrt(1.0 - keep * keep);
    flicker_.col(i).head<3>() = keep * flicker_.col(i).head<3>() + fresh * normal3(noise);
    flicker_.col(i).tail<3>() = keep * flicker_.col(i).tail<3>() + fresh * normal3(noise);
  }
  drift();
}

// Puts the biases together from their parts.
void InertialSensor::drift() {
  const double time = static_cast<double>(count_) / config_.rate_hz;
  const double warmer = config_.warm_up_k * (1.0 - std::exp(-time / config_.warm_up_s));
  const Eigen::Matrix<double, 6, 1> flicker = kFlickerShare * flicker_.rowwise().sum();
  gyro_bias_ = wander_.head<3>() + config_.gyro_instability * flicker.head<3>() +
               warmer * per_kelvin_.head<3>();
  accel_bias_ = wander_.tail<3>() + config_.accel_instability * flicker.tail<3>() +
                warmer * per_kelvin_.tail<3>();
}

bool InertialSensor::lost() {
  if (judged_ == count_) return lost_;
  judged_ = count_;
  lost_ = false;
  if (config_.missing <= 0.0 && config_.gap_interval_s <= 0.0) return false;
  CounterNoise noise(seed_ + 3, static_cast<std::uint64_t>(count_), 0);
  const double dt = 1.0 / config_.rate_hz;
  lost_ = noise.uniform() < config_.missing;
  if (config_.gap_interval_s > 0.0 && gap_left_s_ <= 0.0 &&
      noise.uniform() < dt / config_.gap_interval_s) {
    gap_left_s_ = config_.gap_s;
  }
  if (gap_left_s_ > 0.0) {
    gap_left_s_ -= dt;
    lost_ = true;
  }
  return lost_ && count_ > 0;  // a recording starts with a sample
}

// Harmonics of the carrier's main tone, ever weaker.
Eigen::Vector3d InertialSensor::vibration_harmonics(double time_s) const {
  const double strength = config_.vibration_m_s2 * (1.0 + 0.5 * std::sin(kTau * 0.21 * time_s));
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int i = 2; i <= config_.vibration_tones; ++i) {
    const double phase = i * (kTau * config_.vibration_hz * time_s) +
                         (3.0 + 0.7 * i) * std::sin(kTau * 0.37 * time_s);
    sum +=
        strength / i *
        Eigen::Vector3d(0.6 * std::sin(phase), 0.5 * std::sin(phase + 1.9), std::sin(phase + 0.7));
  }
  return sum;
}

// What is left of the blows of the last half second. The frame rings at some tens of hertz, in a
// direction of its own each time.
void InertialSensor::shake(double time_s, ImuSample& sample) const {
  const auto after = std::upper_bound(shocks_s_.begin(), shocks_s_.end(), time_s);
  for (auto shock = after; shock != shocks_s_.begin();) {
    --shock;
    const double age = time_s - *shock;
    if (age > 0.5) break;
    CounterNoise noise(seed_ + 4, static_cast<std::uint64_t>(shock - shocks_s_.begin()), 0);
    const double size = 0.5 + noise.uniform();
    const double hertz = 25.0 + 30.0 * noise.uniform();
    const Eigen::Vector3d push = normal3(noise).normalized();
    const Eigen::Vector3d twist = normal3(noise).normalized();
    const double ring = size * std::exp(-age / 0.09) * std::sin(kTau * hertz * age);
    sample.specific_force += config_.shock_m_s2 * ring * push;
    sample.angular_rate += config_.shock_rad_s * ring * twist;
  }
}

void InertialSensor::saturate(ImuSample& sample) const {
  const auto clip = [](Eigen::Vector3d& value, double range) {
    if (range > 0.0) value = value.cwiseMax(-range).cwiseMin(range);
  };
  clip(sample.specific_force, config_.accel_range_m_s2);
  clip(sample.angular_rate, config_.gyro_range_rad_s);
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
  if (config_.vibration_tones > 1) sample.specific_force += vibration_harmonics(time);
  if (config_.shock_m_s2 > 0.0 || config_.shock_rad_s > 0.0) shake(time, sample);
  saturate(sample);
  sample.stamp += from_seconds(config_.time_offset_s);
  walk_biases();
  return sample;
}

}  // namespace understory
