#pragma once

#include <vector>

#include "understory/odometry/imu/imu_state.h"
#include "understory/odometry/motion/motion_model.h"

namespace understory {

// One IMU sample as it is kept (no optional parts, so that it can be written as raw bytes).
struct InertialSample {
  TimeNs stamp = 0;
  double gyro[3] = {0.0, 0.0, 0.0};   // rad/s
  double accel[3] = {0.0, 0.0, 0.0};  // specific force, m/s^2
  [[nodiscard]] Eigen::Vector3d angular_rate() const { return {gyro[0], gyro[1], gyro[2]}; }
  [[nodiscard]] Eigen::Vector3d specific_force() const { return {accel[0], accel[1], accel[2]}; }
};

using Vector9d = Eigen::Matrix<double, 9, 1>;
using Matrix9d = Eigen::Matrix<double, 9, 9>;

// Everything the IMU says between two times as one relative motion in the frame of the IMU at the
// first, P2 (3-4) after Forster et al. (2017), with the mean of the two ends of each sampling
// interval instead of its start. Linear in the biases around `gyro_bias`, `accel_bias`.
struct Preintegration {
  double duration = 0.0;                                         // s
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  // Delta R_ij
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();            // Delta v_ij
  Eigen::Vector3d position = Eigen::Vector3d::Zero();            // Delta p_ij
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();           // where it was integrated
  Eigen::Vector3d accel_bias = Eigen::Vector3d::Zero();
  // Derivatives by the biases: rotation (right perturbation), velocity, position.
  Eigen::Matrix<double, 9, 6> by_bias = Eigen::Matrix<double, 9, 6>::Zero();
  Matrix9d covariance = Matrix9d::Zero();  // of (rotation, velocity, position)
  // 1 for an IMU; 0 for the constant-velocity stand-in, which knows no gravity.
  double gravity_weight = 1.0;
};

// The samples' first and last stamps are the ends of the interval; at least two samples. Noise as
// in `noise`; that of the accelerometer is larger where the samples themselves show more.
[[nodiscard]] Preintegration preintegrate(const std::vector<InertialSample>& samples,
                                          const Eigen::Vector3d& gyro_bias,
                                          const Eigen::Vector3d& accel_bias,
                                          const ImuNoiseConfig& noise);

// The stand-in where the IMU is silent: constant velocity and constant angular rate (in the frame
// of the IMU). White accelerations of the given densities disturb it.
[[nodiscard]] Preintegration constant_velocity_interval(double duration,
                                                        const Eigen::Vector3d& angular_rate,
                                                        double accel_sigma,
                                                        double angular_accel_sigma);

// Where the motion leads from `from`; `gravity` in the world, m/s^2, downwards. Biases unchanged.
[[nodiscard]] ImuState predict_state(const ImuState& from, const Preintegration& motion,
                                     TimeNs stamp, const Eigen::Vector3d& gravity);

// Residual (rotation, velocity, position), P2 (4), and its derivatives by both states and by the
// gravity vector.
struct MotionResidual {
  Vector9d error;
  Eigen::Matrix<double, 9, 15> by_from;
  Eigen::Matrix<double, 9, 15> by_to;
  Eigen::Matrix<double, 9, 3> by_gravity;
};
[[nodiscard]] MotionResidual motion_residual(const ImuState& from, const ImuState& to,
                                             const Preintegration& motion,
                                             const Eigen::Vector3d& gravity);

}  // namespace understory
