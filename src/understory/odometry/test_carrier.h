#pragma once

#include <cmath>

#include "understory/odometry/imu/preintegration.h"
#include "understory/odometry/motion/motion_model.h"
#include "understory/util/random.h"

namespace understory {

// For tests: a carrier on an analytic path with an IMU and a lidar that knows its pose up to noise.
// Stands still for `still_s`, then walks in a wavy circle, swinging and turning.
class TestCarrier {
 public:
  struct Config {
    double still_s = 0.0;
    double imu_rate_hz = 200.0;
    double gyro_noise = 2e-3;   // rad/s/sqrt(Hz)
    double accel_noise = 2e-2;  // m/s^2/sqrt(Hz)
    Eigen::Vector3d gyro_bias{0.01, -0.008, 0.005};
    Eigen::Vector3d accel_bias{0.08, -0.05, 0.06};
    Pose body_from_imu;
    double lidar_sigma_m = 0.005;
    double lidar_sigma_rad = 5e-4;
    std::uint64_t seed = 1;
  };

  static constexpr TimeNs kStart = 1'700'000'000'000'000'000;

  explicit TestCarrier(const Config& config)
      : config_(config), imu_noise_(config.seed, 1), lidar_noise_(config.seed, 2) {}

  // Truth; the truth's world is level but has its own origin and heading.
  [[nodiscard]] Pose world_from_body(double t) const {
    const double s = phase(t);
    const Eigen::Vector3d p(8.0 * std::sin(0.15 * s) + 0.1 * std::sin(4.0 * s),
                            8.0 * std::cos(0.15 * s), 1.5 + 0.06 * std::sin(6.0 * s));
    const Eigen::Quaterniond yaw = so3_exp({0.0, 0.0, -0.15 * s + 0.5 * std::sin(0.7 * s)});
    const Eigen::Quaterniond tilt =
        so3_exp({0.15 * std::sin(1.1 * s) + 0.05, 0.2 * std::sin(0.9 * s) - 0.08, 0.0});
    return {yaw * tilt, p};
  }
  [[nodiscard]] Eigen::Vector3d velocity(double t) const {
    return (world_from_body(t + kStep).translation() - world_from_body(t - kStep).translation()) /
           (2.0 * kStep);
  }

  [[nodiscard]] ImuSample imu(double t) {
    const Pose now = world_from_body(t) * config_.body_from_imu;
    const Pose next = world_from_body(t + kStep) * config_.body_from_imu;
    const Pose last = world_from_body(t - kStep) * config_.body_from_imu;
    const Eigen::Vector3d accel =
        (next.translation() - 2.0 * now.translation() + last.translation()) / (kStep * kStep);
    const double root = std::sqrt(config_.imu_rate_hz);
    ImuSample sample;
    sample.stamp = stamp(t);
    sample.angular_rate = so3_log(last.rotation().conjugate() * next.rotation()) / (2.0 * kStep) +
                          config_.gyro_bias + normal(imu_noise_, config_.gyro_noise * root);
    sample.specific_force = now.rotation().conjugate() * (accel + Eigen::Vector3d(0.0, 0.0, 9.81)) +
                            config_.accel_bias + normal(imu_noise_, config_.accel_noise * root);
    return sample;
  }

  // The result of a scan matcher in the world of the model, whose origin is where it began.
  [[nodiscard]] LidarFactor lidar(double t, const Pose& model_from_truth) {
    Vector6d error;
    error << normal(lidar_noise_, config_.lidar_sigma_rad),
        normal(lidar_noise_, config_.lidar_sigma_m);
    LidarFactor factor;
    factor.world_from_body = model_from_truth * world_from_body(t) * Pose::exp(error);
    factor.fitness_m2 = 0.02;
    const double rotation = 1.0 / (config_.lidar_sigma_rad * config_.lidar_sigma_rad);
    const double translation = 1.0 / (config_.lidar_sigma_m * config_.lidar_sigma_m);
    factor.information.diagonal() << Eigen::Vector3d::Constant(rotation),
        Eigen::Vector3d::Constant(translation);
    return factor;
  }

  [[nodiscard]] static TimeNs stamp(double t) { return kStart + from_seconds(t); }

 private:
  static constexpr double kStep = 1e-4;

  // Time of the motion: zero while still, then a soft start.
  [[nodiscard]] double phase(double t) const {
    if (config_.still_s <= 0.0) return t;
    const double moving = t - config_.still_s;
    if (moving <= 0.0) return 0.0;
    return moving - 1.0 + std::exp(-moving) * (1.0 + 0.0 * moving);
  }
  [[nodiscard]] static Eigen::Vector3d normal(Random& random, double sigma) {
    const double x = random.normal();
    const double y = random.normal();
    const double z = random.normal();
    return Eigen::Vector3d(x, y, z) * sigma;
  }

  Config config_;
  Random imu_noise_;
  Random lidar_noise_;
};

}  // namespace understory
