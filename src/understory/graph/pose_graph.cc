#include "understory/graph/pose_graph.h"

#include <gtsam/nonlinear/GncOptimizer.h>
#include <gtsam/nonlinear/LevenbergMarquardtOptimizer.h>

#include <cmath>

#include "understory/graph/loops/loop_agreement.h"
#include "understory/graph/pose_graph_factors.h"
#include "understory/util/error.h"

namespace understory {
namespace {

void check(const PoseGraphProblem& problem) {
  const int n = static_cast<int>(problem.world_from_keyframe.size());
  for (const auto* edges : {&problem.odometry, &problem.loops}) {
    for (const PoseEdge& edge : *edges) {
      UNDERSTORY_CHECK(edge.from >= 0 && edge.from < n && edge.to >= 0 && edge.to < n);
      UNDERSTORY_CHECK(edge.from != edge.to);
    }
  }
  for (const TiltPrior& tilt : problem.tilts)
    UNDERSTORY_CHECK(tilt.keyframe >= 0 && tilt.keyframe < n && tilt.sd_rad > 0.0);
}

double cost(const PoseGraphProblem& problem, const std::vector<Pose>& poses,
            const std::vector<char>& used) {
  const auto pose = [&](int k) -> const Pose& { return poses[static_cast<std::size_t>(k)]; };
  double sum = 0.0;
  for (const PoseEdge& edge : problem.odometry)
    sum += 0.5 * std::pow(edge_residual(edge, pose(edge.from), pose(edge.to)), 2);
  for (std::size_t i = 0; i < problem.loops.size(); ++i) {
    const PoseEdge& edge = problem.loops[i];
    if (used[i] != 0) sum += 0.5 * std::pow(edge_residual(edge, pose(edge.from), pose(edge.to)), 2);
  }
  for (const TiltPrior& tilt : problem.tilts) {
    const Eigen::Vector3d up = pose(tilt.keyframe).rotation() * tilt.up_in_keyframe.normalized();
    sum += 0.5 * up.cross(Eigen::Vector3d::UnitZ()).squaredNorm() / (tilt.sd_rad * tilt.sd_rad);
  }
  return sum;
}

struct Solved {
  gtsam::Values values;
  bool converged = false;
};

Solved solve_plain(gtsam::NonlinearFactorGraph graph, const gtsam::Values& first,
                   const PoseGraphConfig& config) {
  graph.addPrior(gtsam::Key{0}, first.at<gtsam::Pose3>(0),
                 gtsam::noiseModel::Isotropic::Sigma(6, 1e-6));
  gtsam::LevenbergMarquardtOptimizer optimiser(graph, first, lm_params(config));
  Solved solved;
  solved.values = optimiser.optimize();
  solved.converged = optimiser.iterations() < static_cast<std::size_t>(config.max_iterations);
  return solved;
}

// Marks the loops that graduated non-convexity (Yang et al. 2020) gives no weight.
void reject_by_gnc(const PoseGraphProblem& problem, const gtsam::Values& first,
                   const PoseGraphConfig& config, std::vector<char>& used) {
  gtsam::NonlinearFactorGraph graph = build_graph(problem, used);
  graph.addPrior(gtsam::Key{0}, first.at<gtsam::Pose3>(0),
                 gtsam::noiseModel::Isotropic::Sigma(6, 1e-6));
  using Params = gtsam::GncParams<gtsam::LevenbergMarquardtParams>;
  Params params(lm_params(config));
  params.setLossType(gtsam::GncLossType::TLS);
  Params::IndexVector known;
  for (std::size_t i = 0; i < problem.odometry.size(); ++i)
    known.push_back(i);
  for (std::size_t i = graph.size() - 1 - problem.tilts.size(); i < graph.size(); ++i)
    known.push_back(i);
  params.setKnownInliers(known);
  gtsam::GncOptimizer<Params> optimiser(graph, first, params);
  optimiser.setInlierCostThresholds(0.5 * chi_squared_6(config.inlier_probability));
  (void)optimiser.optimize();
  const gtsam::Vector weights = optimiser.getWeights();
  std::size_t at = problem.odometry.size();
  for (char& flag : used) {
    if (flag == 0) continue;
    if (weights[static_cast<Eigen::Index>(at)] < 0.5) flag = 0;
    ++at;
  }
}

}  // namespace

PoseGraphResult optimise_pose_graph(const PoseGraphProblem& problem, const PoseGraphConfig& config,
                                    LoopAgreement* agreement) {
  check(problem);
  PoseGraphResult result;
  result.world_from_keyframe = problem.world_from_keyframe;
  result.loop_used.assign(problem.loops.size(), 1);
  if (problem.world_from_keyframe.empty()) {
    result.converged = true;
    return result;
  }
  gtsam::Values first;
  for (std::size_t k = 0; k < problem.world_from_keyframe.size(); ++k)
    first.insert(k, to_gtsam(problem.world_from_keyframe[k]));

  try {
    if (config.check_consistency) {
      LoopAgreement own(config);
      LoopAgreement& loops = agreement != nullptr ? *agreement : own;
      loops.update(problem);
      result.loop_used = loops.used();
    }
    if (config.robust_loops && !problem.loops.empty())
      reject_by_gnc(problem, first, config, result.loop_used);
    const Solved solved = solve_plain(build_graph(problem, result.loop_used), first, config);
    result.converged = solved.converged;
    if (!solved.converged) result.reason = "iteration limit";
    for (std::size_t k = 1; k < result.world_from_keyframe.size(); ++k)
      result.world_from_keyframe[k] = from_gtsam(solved.values.at<gtsam::Pose3>(k));
  } catch (const std::exception& error) {
    // An indeterminate system: nothing is changed.
    result.reason = error.what();
    result.world_from_keyframe = problem.world_from_keyframe;
    result.loop_used.assign(problem.loops.size(), 0);
  }
  result.initial_cost = cost(problem, problem.world_from_keyframe, result.loop_used);
  result.final_cost = cost(problem, result.world_from_keyframe, result.loop_used);
  const auto residual = [&](const PoseEdge& edge) {
    return edge_residual(edge, result.world_from_keyframe[static_cast<std::size_t>(edge.from)],
                         result.world_from_keyframe[static_cast<std::size_t>(edge.to)]);
  };
  for (const PoseEdge& edge : problem.odometry)
    result.odometry_residual.push_back(residual(edge));
  for (const PoseEdge& edge : problem.loops)
    result.loop_residual.push_back(residual(edge));
  return result;
}

}  // namespace understory
