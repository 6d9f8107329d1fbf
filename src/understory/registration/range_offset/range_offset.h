#pragma once

#include "understory/geometry/pose.h"
#include "understory/registration/range_offset/surface_view.h"
#include "understory/util/config/config.h"

namespace understory {

// How surfaces seen from two places are matched to tell a constant error of all ranges.
struct RangeOffsetConfig {
  SurfaceViewConfig view;
  double kernel_m = 0.05;       // scale of the Geman-McClure kernel at the end; at first ten times
  double max_distance_m = 1.0;  // patches whose means lie farther apart are no match
  double max_angle_deg = 20.0;  // between the normals of a match
  int min_matches = 60;         // fewer say nothing
  int iterations = 12;
  // What is known of the guess: standard deviations. They only matter for directions that the
  // surfaces leave open, as the way along flat ground.
  double guess_translation_m = 0.3;
  double guess_rotation_deg = 3.0;
};
void describe(ConfigTable& table, RangeOffsetConfig& config);

// By how much all ranges of a lidar are too long, as two views of the same surfaces tell.
struct RangeOffset {
  bool solved = false;  // enough matches; else nothing else holds
  double offset_m = 0.0;
  double sd_m = 0.0;  // standard deviation if patches were independent
  int matches = 0;
  Pose target_from_source;
};

// Estimates the relative pose of two views and one range offset o that both have. With patch means
// p, q, rays u, v of source and target and the normal n of both, it makes
//   n . (T (p - o u) - (q - o v)) small, under a Geman-McClure kernel. Muhammad and Lacroix (IROS
//   2010) calibrate extrinsics and ranges by planes in this way; here the motion is an unknown,
//   too. What tells o from T is that the same surface is seen from other sides: near ground is too
//   low by more than far ground. Thread-safe.
[[nodiscard]] RangeOffset solve_range_offset(const SurfaceView& target, const SurfaceView& source,
                                             const Eigen::Vector3d& lidar_in_body,
                                             const Pose& target_from_source,
                                             const RangeOffsetConfig& config);

}  // namespace understory
