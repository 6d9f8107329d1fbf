#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "understory/sensor/imu_sample.h"
#include "understory/simulation/carrier/carrier.h"

namespace understory {

// A magnetometer at the IMU's place: the earth's field, bent by soft iron, plus the constant field
// of the carrier's hard iron, plus white noise. Tesla, in the frame of the IMU.
class Magnetometer {
 public:
  // `path` must outlive the sensor. `start` is the time of the path's zero.
  Magnetometer(const SiteConfig& config, const CarrierPath& path, TimeNs start);

  [[nodiscard]] TimeNs next_stamp() const;
  MagSample next();

 private:
  MagnetometerConfig config_;
  const CarrierPath& path_;
  TimeNs start_;
  std::uint64_t seed_;
  Eigen::Quaterniond imu_from_body_;
  Eigen::Vector3d field_in_world_;
  Eigen::Vector3d hard_iron_;
  Eigen::Matrix3d soft_iron_;
  std::int64_t count_ = 0;
};

}  // namespace understory
