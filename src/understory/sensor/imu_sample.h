#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>

#include "understory/util/time.h"

namespace understory {

// One IMU sample in the frame of the IMU.
struct ImuSample {
  TimeNs stamp = 0;
  Eigen::Vector3d angular_rate = Eigen::Vector3d::Zero();    // rad/s
  Eigen::Vector3d specific_force = Eigen::Vector3d::Zero();  // m/s^2, +9.81 up at rest
  std::optional<Eigen::Quaterniond> orientation;  // world_from_imu where the sensor has it
};

// One magnetometer sample in the frame of the IMU, tesla.
struct MagSample {
  TimeNs stamp = 0;
  Eigen::Vector3d field = Eigen::Vector3d::Zero();
};

}  // namespace understory
