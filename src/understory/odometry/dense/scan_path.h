#pragma once

#include <span>
#include <vector>

#include "understory/geometry/stamped_pose.h"
#include "understory/preprocess/body_cloud.h"
#include "understory/registration/matcher.h"

namespace understory {

// How far a carrier may leave constant velocity, see MotionConfig: what binds the motion within a
// scan.
struct ScanPathConfig {
  double accel_sigma_m_s2 = 1.0;
  double angular_accel_sigma_rad_s2 = 2.0;
  int max_iterations = 8;
  // A bend of so many sigma is no motion but a match gone astray in a direction that the scan
  // leaves open.
  double max_sigmas = 6.0;
};

// Corrections of a path over one scan: right perturbations of the pose at its first moment, turned
// into each other linearly in time.
struct ScanPathCorrection {
  Vector6d at_start = Vector6d::Zero();
  Vector6d at_end = Vector6d::Zero();
  int iterations = 0;  // 0: none was found, and the others are zero
};

// Where the motion within a scan is a guess, as it is without an IMU, a rigid match averages over
// what the guess got wrong. Here the first and the last pose of the scan are matched together. The
// points in between move along in proportion to their time (the elastic scan of Dellenbach et al.,
// CT-ICP, 2022, for any cost of a match).
//   target: the local map that the scan lies in; without a cost there is no correction
//   source: deskewed along the guessed path, body frame at its stamp; thinned
//   duration: from the stamp to the last point, > 0
//   start: the pose of the body at the stamp, best from a rigid match
// The difference of the two corrections is bound by the acceleration the carrier is taken
// capable of. Deterministic for any number of threads. Thread-safe.
[[nodiscard]] ScanPathCorrection match_scan_path(const MatchTarget& target, const BodyCloud& source,
                                                 TimeNs duration, const Pose& start,
                                                 const ScanPathConfig& config);

// The path with the corrections applied, with `path.front()` at the stamp. The correction of a
// later pose is in proportion to its time, also beyond the duration.
[[nodiscard]] std::vector<StampedPose> corrected_path(std::span<const StampedPose> path,
                                                      const Pose& start, TimeNs duration,
                                                      const ScanPathCorrection& correction);

}  // namespace understory
