#pragma once

#include <string>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/util/config/config.h"

namespace understory {

class LoopAgreement;

// A relative pose between two keyframes.
struct PoseEdge {
  int from = 0;
  int to = 0;
  Pose from_from_to;                           // pose of `to` in the frame of `from`
  Matrix6d covariance = Matrix6d::Identity();  // right perturbation, rotation first
};

// Which loops a pose graph accepts, and when its solution ends.
struct PoseGraphConfig {
  bool robust_loops = true;  // graduated non-convexity over the loops, truncated least squares
  // Probability with which a right loop lies within the truncation (6 degrees of freedom).
  double inlier_probability = 0.999;
  bool check_consistency = true;  // drop loops that contradict most others before optimising
  // Two loops contradict each other when their circle does not close within this probability.
  double consistency_probability = 0.995;
  // For that the odometry's standard deviations on the way are taken that many times larger: its
  // errors are not independent from edge to edge.
  double odometry_sigma_scale = 2.0;
  int max_iterations = 50;
  double relative_tolerance = 1e-9;
};
void describe(ConfigTable& table, PoseGraphConfig& config);

// What a keyframe knows of up by itself: the direction that is the world's z axis there.
struct TiltPrior {
  int keyframe = 0;
  Eigen::Vector3d up_in_keyframe = Eigen::Vector3d::UnitZ();
  double sd_rad = 1.0;  // about each level axis
};

// The second graph of P4 F2. Keyframe 0 is held where it is.
struct PoseGraphProblem {
  std::vector<Pose> world_from_keyframe;  // first values
  std::vector<PoseEdge> odometry;         // never rejected
  std::vector<PoseEdge> loops;            // each of them may be wrong
  std::vector<TiltPrior> tilts;           // never rejected
};

// The poses that a pose graph comes to, and what it thinks of its edges.
struct [[nodiscard]] PoseGraphResult {
  bool converged = false;
  std::string reason;  // if not converged
  std::vector<Pose> world_from_keyframe;
  double initial_cost =
      0.0;  // half the sum of squared residuals over odometry, tilts and used loops
  double final_cost = 0.0;
  // Residual of each edge at the solution, in standard deviations (root of the Mahalanobis square).
  std::vector<double> odometry_residual;
  std::vector<double> loop_residual;
  std::vector<char> loop_used;  // 0: rejected as contradicting the rest
};

// Batch optimisation. Deterministic; thread-safe. The graph must be connected by its odometry;
// keyframes that are not reached are an error of the caller. `agreement`: of the same settings and
// of an earlier state of this graph, which it is brought up from; the result is the same without.
// `decided`: the `loop_used` of an earlier state of this graph, whose loops are the first ones of
// `problem`. Of some hundred loops or more it is begun from, and graduated non-convexity is run
// only where the new loops change many of these decisions. The result is then one that the
// truncated least squares do not improve by changing a single decision, but it may be another than
// without.
PoseGraphResult optimise_pose_graph(const PoseGraphProblem& problem, const PoseGraphConfig& config,
                                    LoopAgreement* agreement = nullptr,
                                    const std::vector<char>& decided = {});

// For each loop whether it belongs to the largest set of loops that agree in pairs over the
// odometry between them (Mangelson et al. 2018); one loop alone agrees with itself. Deterministic.
[[nodiscard]] std::vector<char> consistent_loops(const PoseGraphProblem& problem,
                                                 const PoseGraphConfig& config);

// Residual of an edge in standard deviations, and its squared value.
[[nodiscard]] double edge_residual(const PoseEdge& edge, const Pose& world_from_from,
                                   const Pose& world_from_to);

// Quantile of the chi-squared distribution with 6 degrees of freedom.
[[nodiscard]] double chi_squared_6(double probability);

}  // namespace understory
