#pragma once

#include <vector>

#include "understory/geometry/pose.h"
#include "understory/odometry/motion/motion_model.h"
#include "understory/sensor/scan.h"

namespace understory {

// A scan cut by time into parts of `fraction` of its duration (above 0, up to 1), in order of time.
// A last part that would be shorter than half of that goes with the part before it. Each is a scan:
// its stamp is the time of its first point, and points keep their order. Parts without points are
// left out; so are all of a scan without times of points. Thread-safe.
[[nodiscard]] std::vector<Scan> parts_of(const Scan& scan, double fraction);

// The pose between a prediction and a match of the same time, by the covariances of their right
// perturbations (one step of a Kalman filter). Thread-safe.
[[nodiscard]] Pose fuse(const NavState& predicted, const Pose& match, const Matrix6d& covariance);

}  // namespace understory
