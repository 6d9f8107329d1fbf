#pragma once

#include <functional>

#include "understory/registration/registration.h"

namespace understory::internal {

using Evaluate = std::function<PoseCost(const Pose&)>;

// When the steps of a match end.
struct StepLimits {
  int max_iterations = 30;
  double step_translation_m = 5e-4;
  double step_rotation_rad = 5e-5;
  double max_step_m = 0.5;
  double range_m = 10.0;  // makes rotations comparable with translations
  // A last step below the limits is taken without looking where it led: for a minimum that is only
  // the start of the next.
  bool trust_last_step = false;
};

// Where the steps of a match ended.
struct Minimum {
  Pose pose;
  PoseCost at;  // of the pose before, if its last step was trusted
  int iterations = 0;
  bool converged = false;
};

// Newton steps to where the gradient vanishes; a step that runs far past that point is halved. The
// slope decides and not the cost, because the cost also counts how many points meet any cell at
// all. Over smooth ground that is most where the rings of one scan lie on the rings of the other.
// The cost would refuse steps away from there. Directions without any information are not moved
// along.
[[nodiscard]] Minimum minimise(const Evaluate& evaluate, const Pose& guess,
                               const StepLimits& limits);

// Adds 1/2 |log(prior^-1 pose)|^2 in the metric of the prior's information.
void add_term(const PosePrior& prior, const Pose& pose, PoseCost& to);
// Adds 1/2 |pose * point - position|^2 in the metric of the prior's information.
void add_term(const PositionPrior& prior, const Pose& pose, PoseCost& to);
// Adds the penalties of P3 (6, 8), where the points' part of the cost is `points_weight` times half
// the mean of their squared normalised residuals.
void add_term(const PointPenalties& penalties, const Pose& pose, double points_weight,
              PoseCost& to);
// Adds all terms. `points_weight`: matched points times the share of them that counts.
void add_terms(const PoseTerms& terms, const Pose& pose, double points_weight, PoseCost& to);

// Unit directions, rotation scaled by `range_m`, whose information is below `ratio` of the largest.
[[nodiscard]] Eigen::Matrix<double, 6, Eigen::Dynamic> degenerate_directions(
    const Matrix6d& information, double range_m, double ratio);

// Mean distance of points from their origin; 1 for none.
[[nodiscard]] double mean_range(const Points& points);

}  // namespace understory::internal
