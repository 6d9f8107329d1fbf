#pragma once

#include <Eigen/Core>
#include <vector>

#include "understory/geometry/stamped_pose.h"
#include "understory/georeference/satellites/satellite_fit.h"
#include "understory/georeference/satellites/satellite_pairs.h"
#include "understory/odometry/motion/motion_model.h"
#include "understory/sensor/imu_sample.h"

namespace understory {

// Satellite positions smoothed with the IMU (P4 section 5.3): the reference of the fit in six
// degrees of freedom.
struct SatelliteSmoothingConfig {
  PairingConfig pairing;
  Pose body_from_imu;
  ImuNoiseConfig imu;
  // Errors of a receiver are correlated over that long. A position counts as much as the mean of
  // independent ones over the interval would [tuned: docs/method/georeference.md, seeds up to 19].
  double correlation_s = 150.0;
  double overconfidence = 2.2;  // true over stated error of a position [tuned: the same]
  int iterations = 8;
};

// All states at once: preintegrated samples between the times of the pairs (P2 (3, 4)), biases that
// walk, and positions of the antenna. `start` is any motion that lays the path near the fixes: only
// the first guess of the states comes from it. Frame: `origin` of the pairs. Poses of the body with
// their marginal covariance, one a pair. Empty for fewer than three pairs, or where the samples do
// not span them. Deterministic; thread-safe.
[[nodiscard]] std::vector<SmoothedPose> smooth_satellites(
    const std::vector<StampedPose>& trajectory, const std::vector<GnssFix>& fixes,
    const std::vector<ImuSample>& samples, const Pose& start,
    const SatelliteSmoothingConfig& config);

}  // namespace understory
