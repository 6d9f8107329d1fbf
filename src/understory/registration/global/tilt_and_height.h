#pragma once

#include <Eigen/Core>
#include <vector>

#include "understory/geometry/points.h"
#include "understory/geometry/pose.h"
#include "understory/registration/global/uprights.h"
#include "understory/registration/registration.h"

namespace understory {

struct SearchCloud;

// How a thing that stands upright leans. Levelled frame of its cloud, metres.
struct UprightAxis {
  Eigen::Vector2d at = Eigen::Vector2d::Zero();    // middle of its points
  Eigen::Vector2d lean = Eigen::Vector2d::Zero();  // x and y per metre of height
  double variance = 0.0;                           // of each component of the lean
};

// The axes of uprights, by lines through the points within 0.5 m of each. Those are left out of
// which too little shows. Thread-safe, deterministic.
[[nodiscard]] std::vector<UprightAxis> upright_axes(const std::vector<Upright>& uprights,
                                                    const Points& points,
                                                    const std::vector<float>& above_m);

// The means of the points on the ground, one for each square metre: levelled frame, metres.
[[nodiscard]] std::vector<Eigen::Vector3d> ground_means(const Points& points,
                                                        const std::vector<float>& above_m);

// Tilt and height of a source on a target whose place and heading are known.
struct TiltAndHeight {
  Pose target_from_source;                  // between level frames
  Matrix6d information = Matrix6d::Zero();  // of a right perturbation, rotation first
  int axes = 0;                             // stems whose leans were compared
  int ground = 0;                           // square metres of ground that both clouds show
};

// Sparse scans show a stem as a few points a metre, and ground as rings far apart. The points then
// hardly tell tilt and height, though place and heading are right. A stem that leans one way in one
// level frame leans the same way in the other. So the leans of matched stems tell the tilt between
// the frames. Ground that both clouds show tells the height, and tilt a little. Least squares with
// Cauchy weights, with the level frames as a prior. Thread-safe, deterministic.
[[nodiscard]] TiltAndHeight fit_tilt_and_height(const SearchCloud& target,
                                                const SearchCloud& source, const Pose& start);

// What the fit at a pose tells a match of the points of two level frames. Empty for dense clouds,
// whose points tell tilt and height better, and where too few stems meet.
struct SparseBelief {
  Pose start;       // with tilt and height of the fit, or the pose as it was
  PoseTerms terms;  // none or one
};
[[nodiscard]] SparseBelief belief_of_sparse(const SearchCloud& target, const SearchCloud& source,
                                            const Pose& target_from_source);

// The information of a match with that of what entered it beside the points, and the directions
// that are open then. `range_m`: mean distance of the source's points, see
// RegistrationResult::degenerate_directions.
void count_terms(const PoseTerms& terms, double range_m, RegistrationResult& result);

}  // namespace understory
