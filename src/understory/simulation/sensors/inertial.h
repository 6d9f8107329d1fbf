#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "understory/sensor/imu_sample.h"
#include "understory/simulation/carrier/carrier.h"

namespace understory {

// Normal gravity at a latitude on the ellipsoid, less the free-air decrease with height, m/s^2.
[[nodiscard]] double normal_gravity(double latitude_deg, double height_m);

// The IMU: samples of the true motion at its own place with scale errors, biases, vibration, shocks
// and white noise. A bias is the sum of its value at the start, a random walk, a bias instability
// and a drift with the sensor's temperature. The instability is flicker noise: four first-order
// processes whose time constants are a factor of ten apart. They keep the Allan deviation level
// from 3 s to 300 s. Samples come one after another; the biases are those of the last one. The
// turning of the earth is left out.
class InertialSensor {
 public:
  // `path` must outlive the sensor. `start` is the time of the path's zero; `shocks_s` are the
  // moments at which the carrier is hit, since then, in order.
  InertialSensor(const SiteConfig& config, const CarrierPath& path, TimeNs start,
                 std::vector<double> shocks_s = {});

  [[nodiscard]] TimeNs next_stamp() const;
  ImuSample next();
  void skip();  // walks on without making the sample
  // Whether the next sample gets lost on its way (then it should be skipped).
  [[nodiscard]] bool lost();

  [[nodiscard]] const Eigen::Vector3d& gyro_bias() const { return gyro_bias_; }
  [[nodiscard]] const Eigen::Vector3d& accel_bias() const { return accel_bias_; }
  [[nodiscard]] const Pose& body_from_imu() const { return body_from_imu_; }

 private:
  static constexpr int kFlickers = 4;
  using Flicker = Eigen::Matrix<double, 6, kFlickers>;  // gyroscope above accelerometer

  void walk_biases();
  void drift();
  [[nodiscard]] Eigen::Vector3d vibration_harmonics(double time_s) const;
  void shake(double time_s, ImuSample& sample) const;
  void saturate(ImuSample& sample) const;

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
  Eigen::Matrix<double, 6, 1> wander_ = Eigen::Matrix<double, 6, 1>::Zero();  // start and walk
  Flicker flicker_ = Flicker::Zero();  // each of unit variance
  Eigen::Matrix<double, 6, 1> per_kelvin_ = Eigen::Matrix<double, 6, 1>::Zero();
  bool drifts_ = false;
  std::vector<double> shocks_s_;
  double gap_left_s_ = 0.0;
  std::int64_t judged_ = -1;  // the sample that `lost` spoke of last
  bool lost_ = false;
  std::int64_t count_ = 0;
};

}  // namespace understory
