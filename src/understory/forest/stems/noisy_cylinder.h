#pragma once

#include <Eigen/Core>
#include <vector>

#include "understory/forest/stems/stem_detector.h"

namespace understory {

// A slowly tapering cylinder through points that scatter about its surface to all sides. Fitting
// distances makes a stem too thick where the scatter is no longer small beside the radius. A point
// displaced along the surface lies outside of it, and the side that was not seen holds nothing
// against a larger circle. Here the place on the surface from which a point came is unknown and is
// averaged over (expectation maximisation; Dempster, Laird and Rubin, J. R. Stat. Soc. B 39, 1977):
// a point's density is the mean of round Gaussians along the circumference. A place's weight is how
// much of it shows from the directions of view, which are found along the way.
struct NoisyCylinder {
  bool converged = false;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  // at breast height
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();
  double radius_m = 0.0;  // at breast height
  double taper = 0.0;
  double scatter_m = 0.0;       // of the points about the surface, in each direction
  double range_noise_m = 0.0;   // beside it along the beams; 0: it is part of the scatter
  double strays = 0.0;          // share of the returns that belong to something else
  double log_likelihood = 0.0;  // mean over the returns; compares fits to the same points
  // Of centre, slope, radius, taper: what it would be if returns were independent and each place on
  // the surface known.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
};

// The prior of a stem's form before it is fitted; tapers and slopes are tangents.
struct NoisyCylinderConfig {
  double usual_taper = -0.008;   // of the radius per metre of height
  double taper_sd = 0.006;       // how far stems differ from it
  double slope_sd = 0.03;        // how far the slope may leave that of the start
  int max_points = 400;          // every n-th where there are more
  int cycles = 20;               // of two steps and an extrapolation, at most
  double stray_reach_m = 0.1;    // beyond the radius: points of no stem are spread so far
  double most_strays = 0.5;      // share of the returns that are of no stem, at most
  double most_scatter_m = 0.06;  // of ranges
  // Standard deviation of the points along the beams, beside the scatter. 0: it is taken for
  // scatter to all sides, and where there is much of it, stems come out too thin.
  double range_noise_m = 0.0;
  bool find_range_noise = false;  // only begins with that
  double held_radius_m = 0.0;     // a smaller radius is held at this one; 0: such a fit fails
};

// Points should be those within `stray_reach_m` of the stem's surface. Deterministic.
[[nodiscard]] NoisyCylinder fit_noisy_cylinder(const std::vector<SlicePoint>& points,
                                               const StemFit& start,
                                               const NoisyCylinderConfig& config);

}  // namespace understory
