#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "understory/calibration/lidar_imu/path_and_imu.h"

namespace understory {

// What came of a calibration between lidar and IMU.
struct LidarImuResult {
  // Why there is none: a sentence; empty where there is one.
  std::string problem;
  Pose lidar_from_imu;
  double imu_late_s = 0.0;  // the IMU's stamp less that of the lidar, for one moment
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();   // rad/s
  Eigen::Vector3d accel_bias = Eigen::Vector3d::Zero();  // m/s^2
  // Of rotation (right perturbation, frame of the IMU, rad), place (frame of the lidar, m) and
  // lateness (s). Zero along what is kept as it was given.
  Eigen::Matrix<double, 7, 7> covariance = Eigen::Matrix<double, 7, 7>::Zero();
  // What the motion does not tell and was kept as given, a sentence each.
  std::vector<std::string> kept;
  bool lateness_found = true;  // false: it is one of them
  double duration_s = 0.0;     // of the path that was used
};

// Finds how an IMU sits on a lidar, and how late its clock is. It takes a path of the lidar that
// was matched without the IMU's word, and the IMU's samples. Turns about two axes tell the rotation
// and the place, and any motion tells the lateness. Batch fit of gyroscope and accelerometer to the
// path, P2 (3-4), with errors correlated over time. `given` is where the search begins (rotation
// within 60 degrees, lateness within 0.3 s). It stays where the motion tells nothing: along
// directions with a standard deviation above 1 degree, 0.1 m or 5 ms. At least 10 s of path with
// samples, or the result has a problem.
[[nodiscard]] LidarImuResult calibrate_lidar_imu(const std::vector<StampedPose>& world_from_lidar,
                                                 const ImuBuffer& imu, const Pose& given,
                                                 double given_late_s);

}  // namespace understory
