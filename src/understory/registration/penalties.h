#pragma once

#include <Eigen/Core>

#include "understory/geometry/pose.h"
#include "understory/registration/registration.h"

namespace understory {

// What is believed of a pose, in the three parts that P3 section 3.2 adds to ICP. Covariances are
// in the axes of the target.
struct PoseBelief {
  Pose target_from_source;
  Eigen::Vector3d point_in_source = Eigen::Vector3d::Zero();          // the antenna, metres
  Eigen::Matrix3d position_covariance = Eigen::Matrix3d::Identity();  // of the antenna, m^2
  Eigen::Matrix3d attitude_covariance = Eigen::Matrix3d::Identity();  // rotation vector, rad^2
  // The points of gravity and heading lie at least as far away, metres: where they are to say
  // nothing of the position.
  double least_arm_m = 0.0;
};

// The belief of a pose whose right perturbation (rotation first) has this covariance. The antenna
// is the origin of the source; what position and attitude have in common is left out.
[[nodiscard]] PoseBelief belief_of(const Pose& target_from_source, const Matrix6d& covariance);

// The point of the source where a push moves it without turning it, metres, frame of the source.
// `information` is that of a match, of a right perturbation, rotation first. A position that is
// believed there does not tilt a scan. Exact where the points hold it alike in all directions; else
// the nearest that there is. The origin where nothing holds it.
[[nodiscard]] Eigen::Vector3d centre_of_turning(const Matrix6d& information);

// How a belief enters a match.
enum class PenaltyForm {
  kDirect,       // a Gaussian term of the pose itself
  kOnePoint,     // P3 (7) with the position alone: attitude is free and may drift (P3 F4)
  kThreePoints,  // position, one point below it (gravity), one ahead (heading), P3 section 5.1
};

// One term for a match. `arm_m` > 0: how far the points of gravity and heading lie from the
// antenna, metres. Their covariances are that of the position and, `arm_m` away, of the attitude.
// `scale` > 0: s of P3 (8), see PointPenalties. The direct form takes neither.
[[nodiscard]] PoseTerm penalty_term(const PoseBelief& belief, PenaltyForm form, double arm_m = 1.0,
                                    double scale = 1.0);

}  // namespace understory
