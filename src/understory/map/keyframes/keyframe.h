#pragma once

#include "understory/geometry/pose.h"
#include "understory/util/time.h"

namespace understory {

// A scan that stays: node of the second graph of P4 F2.
struct Keyframe {
  TimeNs stamp = 0;
  Pose world_from_body;                    // best estimate so far
  Pose previous_from_this;                 // as the odometry measured it; identity for the first
  Matrix6d covariance = Matrix6d::Zero();  // of previous_from_this, right perturbation
  bool begins_piece = false;               // previous_from_this is a guess: the position was lost
};

}  // namespace understory
