#pragma once

#include "understory/odometry/imu/window_smoother.h"

namespace understory {

// Where a run begins.
struct InitialState {
  Initialisation how = Initialisation::kNoImu;
  ImuState state;
  Eigen::Vector3d up_in_world = Eigen::Vector3d::UnitZ();
  InitialUncertainty sigma;
};

// From the IMU samples around the first scan (possibly none). Still: the mean specific force points
// up and the mean rate is the gyroscope's bias. In motion: the same attitude, but velocity
// and biases are unknown, and the vertical nearly so; the smoother finds them. The body's
// origin becomes the world's, the heading of its x axis zero.
[[nodiscard]] InitialState find_initial_state(const std::vector<InertialSample>& samples,
                                              TimeNs stamp, const Pose& body_from_imu,
                                              const ImuNoiseConfig& config);

// True if the samples could come from a carrier at rest. There must be 0.3 s of them, with the
// scatter of noise and the mean of gravity without turning.
[[nodiscard]] bool is_still(const std::vector<InertialSample>& samples,
                            const ImuNoiseConfig& config);

}  // namespace understory
