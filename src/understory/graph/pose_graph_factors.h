#pragma once

#include <gtsam/geometry/Pose3.h>
#include <gtsam/nonlinear/LevenbergMarquardtParams.h>
#include <gtsam/nonlinear/NonlinearFactorGraph.h>

#include <vector>

#include "understory/geometry/pose.h"
#include "understory/graph/pose_graph.h"

namespace understory {

// What the files of this folder share that solve a graph of keyframes with GTSAM. The key of a
// keyframe is its index. GTSAM's Pose3 has our convention: right perturbation, rotation first.
[[nodiscard]] gtsam::Pose3 to_gtsam(const Pose& pose);
[[nodiscard]] Pose from_gtsam(const gtsam::Pose3& pose);

// A relative pose between two keyframes, with its covariance.
void add_edge(gtsam::NonlinearFactorGraph& graph, const PoseEdge& edge);
// The vertical of one keyframe.
void add_tilt(gtsam::NonlinearFactorGraph& graph, const TiltPrior& tilt);
// Odometry, the loops that `loop_used` marks, and tilts, in this order.
[[nodiscard]] gtsam::NonlinearFactorGraph build_graph(const PoseGraphProblem& problem,
                                                      const std::vector<char>& loop_used);
[[nodiscard]] gtsam::LevenbergMarquardtParams lm_params(const PoseGraphConfig& config);

}  // namespace understory
