#pragma once

#include <vector>

#include "understory/geometry/pose.h"

namespace understory {

// Corrections of a path by Gaussian process regression, which P1 section 5 names as what could
// stand in for its powers.
//
// What the odometry gets wrong in a step is a turn w and a shift v. Its axes are those of the world
// at the place of the view that the step leads to. It is taken as a Gaussian process over the
// steps, with correlation exp(-|m - l| / length). In the plane its sd is that of the odometry times
// `scale`. A match of views j and i observes what the steps between add up to. The correction of a
// view is the posterior mean, added up as motions (SE(3)) from the first view on. It is smooth over
// `length_views`, and where no match tells anything it goes back to the odometry.
struct PathObservation {
  int j = 0;  // the earlier view
  int i = 0;
  Pose j_from_i;
  Matrix6d covariance = Matrix6d::Identity();  // right perturbation
};

// The Gaussian process over a path, P1 section 5; lengths are counted in views.
struct PathProcessConfig {
  // Length and scale are those under which the observations are most likely; or given here (>= 0).
  double length_views = -1.0;
  // An observation that the others contradict is left out, the worst first. Chi squared is that of
  // the turn and shift in the plane (3 degrees of freedom), predicted from the others. 99.9 %.
  double largest_chi2 = 16.27;
};

// The path after the regression, and what the process learnt.
struct [[nodiscard]] PathProcessResult {
  std::vector<Pose> world_from_view;
  std::vector<char> used;     // per observation
  double length_views = 0.0;  // 0: every step errs on its own
  double scale = 1.0;         // of the odometry's sd, yaw and plane
};

// `step_variances`: of a step, diagonal (rotation, translation), z up, all > 0. Without
// observations the path stays. Deterministic; thread-safe. Memory and time are linear in the views
// and quadratic and cubic in the observations.
PathProcessResult regress_path(const std::vector<Pose>& world_from_view,
                               const Vector6d& step_variances,
                               const std::vector<PathObservation>& observations,
                               const PathProcessConfig& config);

}  // namespace understory
