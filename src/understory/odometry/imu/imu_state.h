#pragma once

#include "understory/geometry/pose.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/time.h"

namespace understory {

// Tangent of a state: rotation (3), position (3), both right perturbations in the frame of the IMU;
// velocity (3) in the world; gyroscope bias (3), accelerometer bias (3).
using Vector15d = Eigen::Matrix<double, 15, 1>;
using Matrix15d = Eigen::Matrix<double, 15, 15>;

// What the smoother estimates for one scan, P4 (30), of the IMU itself instead of the body.
struct ImuState {
  TimeNs stamp = 0;
  Pose world_from_imu;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();    // of the IMU's origin in the world, m/s
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();   // rad/s
  Eigen::Vector3d accel_bias = Eigen::Vector3d::Zero();  // m/s^2
};

// Position moves by R d, which is exp of SE(3) to first order (so covariances are the project's).
[[nodiscard]] ImuState retract(const ImuState& state, const Vector15d& d);
// The d with retract(from, d) = to.
[[nodiscard]] Vector15d local(const ImuState& from, const ImuState& to);
// Derivative of local(from, retract(to, d)) by d at d = 0.
[[nodiscard]] Matrix15d local_jacobian(const ImuState& from, const ImuState& to);

// A state in the bytes of checkpoints, and back; reading past the end throws InputError.
void put_state(BinaryWriter& writer, const ImuState& state);
[[nodiscard]] ImuState get_state(BinaryReader& reader);

}  // namespace understory
