#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "understory/sensor/imu_sample.h"
#include "understory/simulation/carrier.h"

namespace understory {

// Normal gravity at a latitude on the ellipsoid, less the free-air decrease with height, m/s^2.
[[nodiscard]] double normal_gravity(double latitude_deg, double height_m);

// The IMU: samples of the true motion at its own place with scale errors, biases that walk,
// vibration and white noise. Samples come one after another; the biases are those of the last one.
// The turning of the earth is left out.
class InertialSensor {
 public:
  // `path` must outlive the sensor. `start` is the time of the path's zero.
  InertialSensor(const SiteConfig& config, const CarrierPath& path, TimeNs start);

  [[nodiscard]] TimeNs next_stamp() const;
  ImuSample next();
  void skip();  // walks on without making the sample

  [[nodiscard]] const Eigen::Vector3d& gyro_bias() const { return gyro_bias_; }
  [[nodiscard]] const Eigen::Vector3d& accel_bias() const { return accel_bias_; }
  [[nodiscard]] const Pose& body_from_imu() const { return body_from_imu_; }

 private:
  void walk_biases();

  ImuConfig config_;
  const CarrierPath& path_;
  TimeNs start_;
  std::uint64_t seed_;
  double gravity_;
  Pose body_from_imu_;
  Eigen::Matrix3d gyro_scale_;
  Eigen::Matrix3d accel_scale_;
  Eigen::Vector3d gyro_bias_;
  Eigen::Vector3d accel_bias_;
  std::int64_t count_ = 0;
};

}  // namespace understory
