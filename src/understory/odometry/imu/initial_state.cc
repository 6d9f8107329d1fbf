#include "understory/odometry/imu/initial_state.h"

#include <cmath>

#include "understory/geometry/pose.h"
#include "understory/geometry/rotation_between.h"
#include "understory/odometry/odometry_constants.h"

namespace understory {
namespace {

using namespace odometry_constants::initial_state;

struct Statistics {
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();
  Eigen::Vector3d force = Eigen::Vector3d::Zero();
  double rate_scatter = 0.0;  // root mean square of the vector's deviation
  double force_scatter = 0.0;
};

Statistics statistics(const std::vector<InertialSample>& samples) {
  Statistics s;
  const auto n = static_cast<double>(samples.size());
  for (const InertialSample& sample : samples) {
    s.rate += sample.angular_rate() / n;
    s.force += sample.specific_force() / n;
  }
  for (const InertialSample& sample : samples) {
    s.rate_scatter += (sample.angular_rate() - s.rate).squaredNorm() / n;
    s.force_scatter += (sample.specific_force() - s.force).squaredNorm() / n;
  }
  s.rate_scatter = std::sqrt(s.rate_scatter);
  s.force_scatter = std::sqrt(s.force_scatter);
  return s;
}

// Attitude of the body with `up_in_body` upwards and the x axis (or y, where x is upright) at
// heading zero.
Eigen::Quaterniond levelled(const Eigen::Vector3d& up_in_body) {
  const auto level = rotation_between(up_in_body, Eigen::Vector3d::UnitZ());
  Eigen::Vector3d axis = level * Eigen::Vector3d::UnitX();
  double heading = 0.0;
  if (axis.head<2>().norm() < kUprightAxis) {
    axis = level * Eigen::Vector3d::UnitY();
    heading = std::acos(-1.0) / 2.0;
  }
  const double turn = heading - std::atan2(axis.y(), axis.x());
  return so3_exp(Eigen::Vector3d(0.0, 0.0, turn)) * level;
}

}  // namespace

bool is_still(const std::vector<InertialSample>& samples, const ImuNoiseConfig& config) {
  if (samples.size() < 10) return false;
  const double span = to_seconds(samples.back().stamp - samples.front().stamp);
  if (span < kShortestStillS) return false;
  const Statistics s = statistics(samples);
  const double root_rate = std::sqrt(3.0 * static_cast<double>(samples.size() - 1) / span);
  return s.rate_scatter < kVibrationRate + 2.0 * root_rate * config.gyro_noise_rad_s_sqrt_hz &&
         s.force_scatter < kVibrationForce + 2.0 * root_rate * config.accel_noise_m_s2_sqrt_hz &&
         s.rate.norm() < kLargestGyroBias &&
         std::abs(s.force.norm() - config.gravity_m_s2) < kForceTolerance;
}

InitialState find_initial_state(const std::vector<InertialSample>& samples, TimeNs stamp,
                                const Pose& body_from_imu, const ImuNoiseConfig& config) {
  InitialState initial;
  initial.sigma.gyro_bias_rad_s = config.gyro_bias_sigma_rad_s;
  initial.sigma.accel_bias_m_s2 = config.accel_bias_sigma_m_s2;
  initial.state.stamp = stamp;
  initial.state.world_from_imu = body_from_imu;
  if (samples.empty()) return initial;

  std::vector<InertialSample> used = samples;
  if (is_still(samples, config)) {
    initial.how = Initialisation::kStill;
  } else {
    initial.how = Initialisation::kInMotion;
    std::erase_if(used, [&](const InertialSample& s) {
      return s.stamp < stamp - kMotionHalfWindow || s.stamp > stamp + kMotionHalfWindow;
    });
    if (used.empty()) used = samples;
  }
  const Statistics s = statistics(used);
  if (initial.how == Initialisation::kStill) {
    initial.state.gyro_bias = s.rate;
    initial.sigma.gyro_bias_rad_s = std::min(config.gyro_bias_sigma_rad_s, kStillBias);
    initial.sigma.velocity_m_s = kStillVelocity;
  }
  if (s.force.norm() > 0.0) {
    const Pose body(levelled(body_from_imu.rotation() * s.force.normalized()),
                    Eigen::Vector3d::Zero());
    initial.state.world_from_imu = body * body_from_imu;
  }
  return initial;
}

}  // namespace understory
