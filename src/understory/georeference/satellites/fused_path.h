#pragma once

#include <string>
#include <vector>

#include "understory/geometry/stamped_pose.h"
#include "understory/georeference/satellites/satellite_pairs.h"
#include "understory/georeference/satellites/split_fit.h"
#include "understory/graph/gnss_fusion.h"
#include "understory/graph/pose_graph.h"
#include "understory/sensor/gnss_fix.h"
#include "understory/util/config/config.h"
#include "understory/util/time.h"

namespace understory {

// A run whose graph was solved without positions by satellites.
struct SolvedRun {
  PoseGraphProblem graph;               // world frame, its z axis up; its poses are the solution
  std::vector<char> loop_used;          // of graph.loops
  std::vector<TimeNs> stamps;           // of the keyframes, in order
  std::vector<StampedPose> trajectory;  // of the scans, world frame, in order of time
};

// Settings of positions by satellites beside or in the graph.
struct FusedPathConfig {
  GnssFusionConfig fusion;
  // Standard deviations of the odometry over those that the graph states. The graph's are large so
  // that loops close [chosen: drift on handheld is 0.002 to 0.015 % of 250 m, stated are 0.06 %].
  double odometry_scale = 0.1;
  // Standard deviation of its natural logarithm before the positions are looked at.
  double odometry_scale_log = 1.0;
  // Pairs of antenna and fixes that become factors, at most [bound: time].
  int most_positions = 1000;
};
void describe(ConfigTable& table, FusedPathConfig& config);

// How keyframes lie by the positions together with the graph. Frame east, north, up at the first
// fix.
struct [[nodiscard]] FusedPath {
  bool found = false;
  std::string reason;  // if not
  std::vector<Pose> enu_from_keyframe;
  std::vector<StampedPose> enu_from_body;  // of the scans
  // Of a small motion of the whole path: a right perturbation of its frame (rotation first).
  Matrix6d covariance = Matrix6d::Zero();
  double expected_error_m = 0.0;  // of a place on the path by that, root mean square
  // How far the positions moved the keyframes against the best rigid motion, root mean square.
  double bent_m = 0.0;
  double odometry_scale = 1.0;  // that the positions made probable
  GnssErrors errors;            // of the receiver, as estimated
  std::size_t positions = 0;    // factors
  double weight = 0.0;          // of them by the kernel, mean
};

// The positions become factors of the graph (P2-6, P4-5). What the clouds say of its shape stays:
// edges say again what the solved poses say, and are as stiff as the positions make probable. Then
// the path as a whole is laid on the fixes by `fit_split`, which knows more kinds of errors than
// the graph. `enu_from_world` is a rigid fit of the same path to the same fixes. Deterministic;
// thread-safe.
FusedPath fuse_path(const SolvedRun& run, const std::vector<GnssFix>& fixes,
                    const Pose& enu_from_world, const PairingConfig& pairing,
                    const SplitFitConfig& split, const FusedPathConfig& config);

}  // namespace understory
