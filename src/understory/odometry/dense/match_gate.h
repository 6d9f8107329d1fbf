#pragma once

#include <string>

#include "understory/odometry/motion/motion_prediction.h"

namespace understory {

// Whether a match fits what the motion allows, P2-8.
struct [[nodiscard]] GateVerdict {
  std::string reason;            // why not; empty: it fits
  double velocity_jump_m_s = 0;  // how much the match changes, or would change, the velocity
};

// `before` is the state at the scan before, `predicted` the one at this scan without the match,
// `with_match` with it. `match` is the IMU's pose by matching, with the covariance of a right
// perturbation (rotation first). What match or prediction do not know opens the gate. Thread-safe.
GateVerdict judge_match(const MotionConfig& config, const ImuState& before,
                        const MotionPrediction& predicted, const ImuState& with_match,
                        const Pose& match, const Matrix6d& match_covariance);

}  // namespace understory
