#include "understory/simulation/sensors/magnetometer.h"

#include <cmath>

#include "understory/simulation/sensors/counter_noise.h"
#include "understory/simulation/sensors/scanner.h"
#include "understory/util/angles.h"

namespace understory {
namespace {

constexpr double kTesla = 1e-6;  // of a microtesla

}  // namespace

Magnetometer::Magnetometer(const SiteConfig& config, const CarrierPath& path, TimeNs start)
    : config_(config.mag),
      path_(path),
      start_(start),
      seed_(hash_numbers(static_cast<std::uint64_t>(config.seed), stream_of(NoiseStream::kMag))),
      imu_from_body_(
          mount_pose(config.imu.mount_m, config.imu.mount_rpy_deg).rotation().conjugate()) {
  const double level = config_.field_ut * std::cos(config_.inclination_deg * kDegree);
  const double declination = config_.declination_deg * kDegree;
  field_in_world_ = {level * std::sin(declination), level * std::cos(declination),
                     -config_.field_ut * std::sin(config_.inclination_deg * kDegree)};
  CounterNoise noise(seed_, 0, 1);
  hard_iron_ = config_.hard_iron_ut * normal3(noise).normalized();
  Eigen::Matrix3d bend;
  for (int i = 0; i < 3; ++i)
    bend.row(i) = normal3(noise).transpose();
  soft_iron_ = Eigen::Matrix3d::Identity() + 0.5 * config_.soft_iron * (bend + bend.transpose());
}

TimeNs Magnetometer::next_stamp() const {
  return start_ +
         static_cast<TimeNs>(std::llround(static_cast<double>(count_) * 1e9 / config_.rate_hz));
}

MagSample Magnetometer::next() {
  MagSample sample;
  sample.stamp = next_stamp();
  CounterNoise noise(seed_ + 1, static_cast<std::uint64_t>(count_), 0);
  ++count_;
  const Pose pose = path_.pose(to_seconds(sample.stamp - start_));
  const Eigen::Vector3d field = imu_from_body_ * (pose.rotation().conjugate() * field_in_world_);
  sample.field = kTesla * (soft_iron_ * field + hard_iron_ + config_.noise_ut * normal3(noise));
  return sample;
}

}  // namespace understory
