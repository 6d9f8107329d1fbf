#pragma once

#include <limits>
#include <string>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/graph/pose_graph.h"
#include "understory/util/time.h"

namespace understory {

// A position by satellites, and where the antenna was by the keyframe before it.
struct GnssObservation {
  int keyframe = 0;
  TimeNs stamp = 0;
  Eigen::Vector3d antenna_in_keyframe = Eigen::Vector3d::Zero();  // m
  Eigen::Vector3d position_in_enu = Eigen::Vector3d::Zero();      // m
  bool has_height = true;                                         // else z is no measurement
  // Of its errors against those of the others, 1 in the median.
  double plane_scale = 1.0;
  double height_scale = 1.0;
  double extra_plane_m = 0.0;  // independent errors of one that lies far off the others
  double extra_height_m = 0.0;
  // By a second antenna: where a direction of the keyframe points, rad from east to north. NaN:
  // there is no heading.
  Eigen::Vector3d direction_in_keyframe = Eigen::Vector3d::UnitX();
  double azimuth_rad = std::numeric_limits<double>::quiet_NaN();
  double azimuth_sd_rad = 1.0;
};

// How positions by satellites err, standard deviations in metres. The slow part is correlated over
// time (a first-order Gauss-Markov process), the fast part is not.
struct GnssErrors {
  double slow_plane_m = 2.0;  // each axis
  double fast_plane_m = 0.5;
  double slow_height_m = 4.0;
  double fast_height_m = 1.0;
  double correlation_s = 100.0;
};

// Settings of the pose graph with positions by satellites.
struct GnssFusionConfig {
  double bias_interval_s = 1.0;  // between two values of the slow part
  // The kernel (Cauchy): residuals beyond that many standard deviations of the fast part count
  // less.
  double kernel_sigmas = 2.0;
  // Of the vertical of the first keyframe, before it is seen. No setting: whether there was an IMU
  // tells it.
  double tilt_sd_deg = 0.5;
  double relative_tolerance = 1e-6;
  int max_iterations = 100;
};
void describe(ConfigTable& table, GnssFusionConfig& config);

// The path with positions by satellites, in the frame east, north, up.
struct [[nodiscard]] GnssFusionResult {
  bool converged = false;
  std::string reason;  // if not converged
  std::vector<Pose> enu_from_keyframe;
  Matrix6d first_covariance = Matrix6d::Zero();  // of the first keyframe, right perturbation
  Matrix6d last_covariance = Matrix6d::Zero();   // of the last one
  double expected_error_m = 0.0;                 // of a keyframe's place, root mean square
  // Logarithm of the probability of the positions (Laplace), up to a constant. Of the same
  // positions, it compares covariances of the odometry and errors of the receiver.
  double log_evidence = 0.0;
  std::vector<double> weight;             // of each observation by the kernel, 0 to 1
  std::vector<Eigen::Vector3d> residual;  // position minus antenna, metres
};

// Solves the pose graph together with positions by satellites (P2-6, P4-5). In it are odometry, the
// loops that `loop_used` marks, tilts, positions with a lever arm and headings of a second antenna.
// The receivers' slow errors are estimated along. Nothing is held: the positions tell where the
// path is. `problem` is in its world frame, whose z axis is up; `enu_from_world` is a first guess,
// for instance from a rigid fit. Deterministic; thread-safe. Where the system is undetermined the
// path is that of the guess.
GnssFusionResult fuse_gnss(const PoseGraphProblem& problem, const std::vector<char>& loop_used,
                           const std::vector<GnssObservation>& observations,
                           const Pose& enu_from_world, const GnssErrors& errors,
                           const GnssFusionConfig& config);

}  // namespace understory
