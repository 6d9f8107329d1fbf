#include "understory/graph/pose_graph_factors.h"

#include <gtsam/navigation/AttitudeFactor.h>
#include <gtsam/slam/BetweenFactor.h>

namespace understory {

gtsam::Pose3 to_gtsam(const Pose& pose) {
  return {gtsam::Rot3(pose.rotation()), pose.translation()};
}

Pose from_gtsam(const gtsam::Pose3& pose) {
  return {pose.rotation().toQuaternion(), pose.translation()};
}

void add_edge(gtsam::NonlinearFactorGraph& graph, const PoseEdge& edge) {
  // GTSAM's Pose3 has our convention: right perturbation, rotation first.
  graph.emplace_shared<gtsam::BetweenFactor<gtsam::Pose3>>(
      static_cast<gtsam::Key>(edge.from), static_cast<gtsam::Key>(edge.to),
      to_gtsam(edge.from_from_to),
      gtsam::noiseModel::Gaussian::Covariance(gtsam::Matrix(edge.covariance)));
}

void add_tilt(gtsam::NonlinearFactorGraph& graph, const TiltPrior& tilt) {
  graph.emplace_shared<gtsam::Pose3AttitudeFactor>(
      static_cast<gtsam::Key>(tilt.keyframe), gtsam::Unit3(Eigen::Vector3d::UnitZ()),
      gtsam::noiseModel::Isotropic::Sigma(2, tilt.sd_rad), gtsam::Unit3(tilt.up_in_keyframe));
}

gtsam::LevenbergMarquardtParams lm_params(const PoseGraphConfig& config) {
  gtsam::LevenbergMarquardtParams params;
  params.maxIterations = static_cast<std::size_t>(config.max_iterations);
  params.relativeErrorTol = config.relative_tolerance;
  params.absoluteErrorTol = 1e-12;
  params.orderingType = gtsam::Ordering::COLAMD;
  return params;
}

gtsam::NonlinearFactorGraph build_graph(const PoseGraphProblem& problem,
                                        const std::vector<char>& used) {
  gtsam::NonlinearFactorGraph graph;
  for (const PoseEdge& edge : problem.odometry)
    add_edge(graph, edge);
  for (std::size_t i = 0; i < problem.loops.size(); ++i) {
    if (used[i] != 0) add_edge(graph, problem.loops[i]);
  }
  for (const TiltPrior& tilt : problem.tilts)
    add_tilt(graph, tilt);
  return graph;
}

}  // namespace understory
