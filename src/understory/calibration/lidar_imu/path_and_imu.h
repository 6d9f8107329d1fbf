#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "understory/geometry/stamped_pose.h"
#include "understory/odometry/imu/imu_buffer.h"

namespace understory {

// What is fitted: how the IMU sits on the lidar, and by how much its clock is late. Also the errors
// that the IMU and the path's frame add.
struct LidarImuState {
  Pose lidar_from_imu;
  double imu_late_s = 0.0;  // the IMU's stamp less that of the lidar, for one moment
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();   // rad/s
  Eigen::Vector3d accel_bias = Eigen::Vector3d::Zero();  // m/s^2
  Eigen::Vector3d gravity = {0.0, 0.0, -9.81};           // m/s^2, in the frame of the path
  // What scale and axes of the sensors are off by: the true value is (1 + error) times the sample.
  Eigen::Matrix3d gyro_axes = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d accel_axes = Eigen::Matrix3d::Zero();
  // By how much the path is off where the motion within a scan bends. It is multiplied by the cube
  // of the step between scans and the third derivative of attitude and place. To a swing that looks
  // like a lateness which grows with the square of its frequency.
  double turn_bend = 0.0;
  double place_bend = 0.0;
};

// Order of a step of the IMU: rotation (3, right perturbation, in its frame), place (3, in the
// frame of the lidar), and lateness (1). Then biases (3 + 3), gravity (3), errors of the axes (9 +
// 9, column by column), and bends (1 + 1). Radians, metres, seconds.
inline constexpr Eigen::Index kLidarImuParameters = 36;
inline constexpr Eigen::Index kLatenessParameter = 6;
using LidarImuStep = Eigen::Matrix<double, kLidarImuParameters, 1>;
using LidarImuMatrix = Eigen::Matrix<double, kLidarImuParameters, kLidarImuParameters>;
[[nodiscard]] LidarImuState stepped(const LidarImuState& state, const LidarImuStep& step);

// By how much path and IMU differ at one scan after the other. Of three axes, rows 3 k to 3 k + 2
// are those of scan k; of one axis row k is.
struct PathResiduals {
  Eigen::VectorXd values;
  Eigen::Matrix<double, Eigen::Dynamic, kLidarImuParameters> by_step;
  Eigen::Index axes = 3;  // or 1
};

// Poses in a row that the samples of the IMU cover without a gap.
using PathRun = std::vector<StampedPose>;

// Cuts a path where scans lie more than half a second apart or the IMU is silent at any lateness
// within `latest_s` of `imu_late_s`. Runs have at least 20 poses and at most 1000.
[[nodiscard]] std::vector<PathRun> runs_with_imu(const std::vector<StampedPose>& world_from_lidar,
                                                 const ImuBuffer& imu, double imu_late_s,
                                                 double latest_s);

// Turns from scan to scan, in the frame of the IMU, radians. Each is the rotation vector from what
// the gyroscope says, P2 (3), to what the path says. One for each step of the run. Velocities from
// step to step, in the frame of the path, m/s: P2 (4) with the velocity eliminated. It is the
// change of the IMU's mean velocity from one step of the path to the next. What gravity and
// accelerometer make of it is taken off. One for each pair of steps. With derivatives, found
// numerically. Throws InternalError where the IMU does not cover the run at the state's lateness.
struct LidarImuResiduals {
  PathResiduals turns;
  PathResiduals velocities;
};
[[nodiscard]] LidarImuResiduals lidar_imu_residuals(const PathRun& run, const ImuBuffer& imu,
                                                    const LidarImuState& state);

}  // namespace understory
