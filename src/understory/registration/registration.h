#pragma once

#include <Eigen/Core>
#include <string>
#include <variant>
#include <vector>

#include "understory/geometry/points.h"
#include "understory/geometry/pose.h"

namespace understory {

// What is known of the pose before matching; added to the cost as a Gaussian.
struct PosePrior {
  Pose target_from_source;
  Matrix6d information = Matrix6d::Zero();  // of a right perturbation, rotation first
};

// Where a point of the source is expected, e.g. a GNSS antenna; added to the cost as a
// Gaussian.
struct PositionPrior {
  Eigen::Vector3d position_in_target;
  Eigen::Vector3d point_in_source = Eigen::Vector3d::Zero();  // lever arm
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();      // of the position, 1/m^2
};

// A point whose partner is known, P3 (7): e = position_in_target - target_from_source *
// point_in_source counts in the metric of the covariance.
struct PenaltyPoint {
  Eigen::Vector3d position_in_target = Eigen::Vector3d::Zero();
  Eigen::Vector3d point_in_source = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  // axes of the target, m^2
};

// Penalty points of P3 (6): the mean over them of e^T W^-1 e counts as much as the mean over the
// matched points, whatever their numbers. `scale` > 0: s of (8), by which the points count more.
// See penalties.h for the points of position, gravity and heading.
struct PointPenalties {
  std::vector<PenaltyPoint> points;
  double scale = 1.0;
};

// What counts beside the points. A new kind of term is one more type here and its `add_term` in
// solve.cc; every matcher then takes it.
using PoseTerm = std::variant<PosePrior, PositionPrior, PointPenalties>;
using PoseTerms = std::vector<PoseTerm>;

// Cost of a pose (for information) with its gradient and a positive semidefinite (or exact) Hessian
// with respect to a right perturbation, rotation first.
struct PoseCost {
  double cost = 0.0;
  Vector6d gradient = Vector6d::Zero();
  Matrix6d hessian = Matrix6d::Zero();
};

// How a match ended. Only the first two gave a pose of their own.
enum class RegistrationStatus {
  kConverged,
  kIterationLimit,  // the step had not become small; the pose is still the best found
  kDegenerate,      // nothing at all constrains the pose; pose = guess
  kTooFewPoints,    // source or target too small to match; pose = guess
  kTooFewMatches,   // hardly any source point near the target; pose = guess
};
// The name of a status in messages and tables.
[[nodiscard]] std::string to_string(RegistrationStatus status);

// The result of every matcher.
struct RegistrationResult {
  RegistrationStatus status = RegistrationStatus::kTooFewPoints;
  std::string reason;  // for the log and the report, empty if converged
  Pose target_from_source;
  Matrix6d information = Matrix6d::Zero();  // right perturbation at the solution, 1/rad^2, 1/m^2
  // Mean squared distance of matched points from what they matched, P4 (36); lower is better. NDT:
  // from the mean of the nearest cell; ICP: from the nearest target point.
  double fitness_m2 = 0.0;
  // The same along the directions that the target's surface constrains (point to plane). 0 for a
  // perfect match, while fitness_m2 never falls below the spacing of the target.
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

// The fitness of P4 (36) over all points of the source, m^2. A point without a match counts as one
// at the reach of the target (MatchTarget::reach_m), metres.
[[nodiscard]] inline double overall_fitness_m2(const RegistrationResult& result, double reach_m) {
  return result.inlier_ratio * result.fitness_m2 + (1.0 - result.inlier_ratio) * reach_m * reach_m;
}

}  // namespace understory
