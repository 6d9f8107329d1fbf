#pragma once

#include <vector>

#include "understory/geometry/stamped_pose.h"
#include "understory/odometry/imu/imu_buffer.h"
#include "understory/odometry/imu/imu_state.h"

namespace understory {

// A state of the IMU with how fast it turns (rad/s, frame of the IMU) and what is known of it.
struct MotionPrediction {
  ImuState state;
  Eigen::Vector3d angular_rate = Eigen::Vector3d::Zero();
  // Of rotation, position (right perturbations), velocity.
  Matrix9d covariance = Matrix9d::Zero();
};

// The state of the body that the IMU is fixed to.
[[nodiscard]] NavState body_state(const MotionPrediction& prediction, const Pose& body_from_imu);

// Where motion leads from a state: by the IMU as far as its samples reach, then by constant
// velocity. `gravity`: in the world, m/s^2, downwards. Holds references to what it is made of, so
// it is for use on the spot. Thread-safe as long as those do not change.
class MotionPredictor {
 public:
  // `buffer` null: constant velocity only.
  MotionPredictor(const MotionConfig& config, const ImuBuffer* buffer,
                  const Eigen::Vector3d& gravity)
      : config_(config), buffer_(buffer), gravity_(gravity) {}

  // At `to`; `from` itself if that is not before it.
  [[nodiscard]] MotionPrediction predict(const MotionPrediction& from, TimeNs to) const;

  // The states from `from` (included) to `to` (included), one for each sample in between.
  // `fixed_velocity` (world, m/s): the accelerometer is not used, only the gyroscope is.
  [[nodiscard]] std::vector<ImuState> path(
      const MotionPrediction& from, TimeNs to,
      const std::optional<Eigen::Vector3d>& fixed_velocity) const;

 private:
  [[nodiscard]] MotionPrediction advance(const MotionPrediction& from, const Preintegration& motion,
                                         TimeNs stamp) const;

  const MotionConfig& config_;
  const ImuBuffer* buffer_;
  Eigen::Vector3d gravity_;
};

// Constant velocity and angular rate, as uncertain as the configuration says.
[[nodiscard]] Preintegration coast(double duration_s, const Eigen::Vector3d& angular_rate,
                                   const MotionConfig& config);

}  // namespace understory
