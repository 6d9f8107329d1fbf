#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "understory/geometry/pose.h"

namespace understory {

// A place of the run that was surveyed. Metres; z of `target` is NaN where no height is known.
struct ControlPoint {
  std::string name;
  Eigen::Vector3d place_in_world = Eigen::Vector3d::Zero();
  Eigen::Vector3d place_in_target = Eigen::Vector3d::Zero();
};

// How control points are fitted.
struct ControlFitConfig {
  double tilt_sd_deg = 0.05;  // how far the run's up may be off, each level axis
  // Error of a point in the run and in the survey together, one axis, before the points are looked
  // at. Their residuals change it as far as there are more points than unknowns [chosen].
  double sd_m = 0.1;
  double least_blunder_m = 0.3;  // what agrees better with the others is no blunder [chosen]
};

// The motion that lays a run on control points.
struct ControlFit {
  bool found = false;
  std::string reason;  // if not
  Pose target_from_world;
  Matrix6d covariance = Matrix6d::Zero();  // right perturbation, rotation first
  std::vector<Eigen::Vector3d> residuals;  // surveyed minus moved place; z NaN without a height
  std::vector<char> used;                  // 0: a blunder
  double sd_m = 0.0;                       // of a coordinate, from the residuals
  // More coordinates than unknowns, of the used points: 0 means that nothing is checked.
  int redundant = 0;
  // The points do not agree, and there are too few to tell which is wrong.
  bool disagree = false;
};

// Heading, place and height by least squares, the tilt held by its prior. A blunder is found by the
// motions of all pairs of points: that with the least median residual tells which points agree.
// Four points find one. Not found for fewer than two points, points of one place, or no height.
// Deterministic; thread-safe.
[[nodiscard]] ControlFit fit_control_points(const std::vector<ControlPoint>& points,
                                            const ControlFitConfig& config);

}  // namespace understory
