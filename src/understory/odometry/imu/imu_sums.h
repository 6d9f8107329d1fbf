#pragma once

#include <Eigen/Core>
#include <vector>

#include "understory/odometry/imu/imu_state.h"
#include "understory/odometry/imu/preintegration.h"

namespace understory {

// What IMU samples in order of time tell by themselves, without an estimate of the biases. Frame of
// the IMU; thread-safe.

// Mean specific force, m/s^2, by the trapezoidal rule.
[[nodiscard]] Eigen::Vector3d mean_force(const std::vector<InertialSample>& samples);
// How the gyroscope alone turned from the first to the last sample, a rotation vector.
[[nodiscard]] Eigen::Vector3d raw_turn(const std::vector<InertialSample>& samples);
// All the turning that the gyroscope tells of, to and fro, radians.
[[nodiscard]] double turning(const std::vector<InertialSample>& samples);

// The state moved on by one sampling interval, without covariances.
[[nodiscard]] ImuState step_state(const ImuState& from, const InertialSample& a,
                                  const InertialSample& b, const Eigen::Vector3d& gravity);

}  // namespace understory
