#pragma once

#include <functional>
#include <optional>

#include "understory/registration/registration.h"

namespace understory::internal {

// Cost of a pose (for information) with its gradient and a positive semidefinite (or exact) Hessian
// with respect to a right perturbation.
struct Quadratic {
  double cost = 0.0;
  Vector6d gradient = Vector6d::Zero();
  Matrix6d hessian = Matrix6d::Zero();
};
using Evaluate = std::function<Quadratic(const Pose&)>;

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

struct Minimum {
  Pose pose;
  Quadratic at;  // of the pose before, if its last step was trusted
  int iterations = 0;
  bool converged = false;
};

// Newton steps to where the gradient vanishes; a step that runs far past that point is halved. The
// slope decides and not the cost, because the cost also counts how many points meet any cell at
// all: over smooth ground that is most where the rings of one scan lie on the rings of the other,
// and steps away from there would be refused. Directions without any information are not moved
// along.
[[nodiscard]] Minimum minimise(const Evaluate& evaluate, const Pose& guess,
                               const StepLimits& limits);

// Adds 1/2 |log(prior^-1 pose)|^2 in the metric of the prior's information.
void add_prior(const PosePrior& prior, const Pose& pose, Quadratic& to);

// Unit directions, rotation scaled by `range_m`, whose information is below `ratio` of the largest.
[[nodiscard]] Eigen::Matrix<double, 6, Eigen::Dynamic> degenerate_directions(
    const Matrix6d& information, double range_m, double ratio);

// Mean distance of points from their origin; 1 for none.
[[nodiscard]] double mean_range(const Points& points);

}  // namespace understory::internal
