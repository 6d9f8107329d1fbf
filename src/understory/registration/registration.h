#pragma once

#include <Eigen/Core>
#include <string>

#include "understory/geometry/points.h"
#include "understory/geometry/pose.h"

namespace understory {

// What is believed of the pose before matching; added to the cost as a Gaussian.
struct PosePrior {
  Pose target_from_source;
  Matrix6d information = Matrix6d::Zero();  // of a right perturbation, rotation first
};

enum class RegistrationStatus {
  kConverged,
  kIterationLimit,  // the step had not become small; the pose is still the best found
  kDegenerate,      // nothing at all constrains the pose; pose = guess
  kTooFewPoints,    // source or target too small to match; pose = guess
  kTooFewMatches,   // hardly any source point near the target; pose = guess
};
[[nodiscard]] std::string to_string(RegistrationStatus status);

// The answer of every matcher.
struct RegistrationResult {
  RegistrationStatus status = RegistrationStatus::kTooFewPoints;
  std::string reason;  // for the log and the report, empty if converged
  Pose target_from_source;
  Matrix6d information = Matrix6d::Zero();  // right perturbation at the solution, 1/rad^2, 1/m^2
  // Mean squared distance of matched points from what they matched, P4 (36); lower is better. NDT:
  // from the mean of the nearest cell; ICP: from the nearest target point.
  double fitness_m2 = 0.0;
  // The same along the directions that the target's surface constrains (point to plane); 0 for a
  // perfect match, unlike fitness_m2, which never falls below the spacing of the target.
  double surface_residual_m2 = 0.0;
  double inlier_ratio = 0.0;  // share of source points with a match, 0..1
  int iterations = 0;
  // Unit directions of the tangent space (rotation first, rotation scaled by the mean range of the
  // points) that the match leaves undetermined; columns, possibly none.
  Eigen::Matrix<double, 6, Eigen::Dynamic> degenerate_directions{6, 0};

  [[nodiscard]] bool usable() const {
    return status == RegistrationStatus::kConverged ||
           status == RegistrationStatus::kIterationLimit;
  }
};

}  // namespace understory
