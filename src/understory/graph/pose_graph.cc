#include "understory/graph/pose_graph.h"

#include <gtsam/nonlinear/GncOptimizer.h>
#include <gtsam/nonlinear/LevenbergMarquardtOptimizer.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "understory/graph/graph_constants.h"
#include "understory/graph/loops/loop_agreement.h"
#include "understory/graph/pose_graph_factors.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using namespace graph_constants::pose_graph;

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

// Residuals of all loops, squared.
std::vector<double> loop_distances(const PoseGraphProblem& problem, const gtsam::Values& values) {
  std::vector<double> distances;
  for (const PoseEdge& edge : problem.loops) {
    const auto at = [&](int k) {
      return from_gtsam(values.at<gtsam::Pose3>(static_cast<gtsam::Key>(k)));
    };
    distances.push_back(std::pow(edge_residual(edge, at(edge.from), at(edge.to)), 2));
  }
  return distances;
}

// Of the loops from `known` on that are `kept`, keeps those that cost less than to leave them out,
// one after another. `without`: the solution without them.
Solved add_singly(const PoseGraphProblem& problem, const Solved& without,
                  const PoseGraphConfig& config, std::size_t known, std::vector<char>& kept) {
  const double limit = chi_squared_6(config.inlier_probability);
  const std::vector<char> wanted(kept);
  std::fill(kept.begin() + static_cast<std::ptrdiff_t>(known), kept.end(), 0);
  Solved solved = without;
  double cost = build_graph(problem, kept).error(solved.values);
  for (std::size_t i = known; i < kept.size(); ++i) {
    if (wanted[i] == 0) continue;
    kept[i] = 1;
    const gtsam::NonlinearFactorGraph graph = build_graph(problem, kept);
    Solved with = solve_plain(graph, solved.values, config);
    const double cost_with = graph.error(with.values);
    if (cost_with - cost > 0.5 * limit) {
      kept[i] = 0;
      continue;
    }
    cost = cost_with;
    solved = std::move(with);
  }
  return solved;
}

// Takes over what was `decided` of the first loops, and decides the new ones by the truncated cost.
// They are used where that costs less than to leave them out. Then the decisions have to be those
// of their own solution. Loops that are used lie within the truncation there, those that are not do
// not. Where few do not agree, they change sides; else nothing comes of it. `used`, in: the loops
// that agree with each other.
std::optional<Solved> keep_decisions(const PoseGraphProblem& problem, const gtsam::Values& first,
                                     const PoseGraphConfig& config,
                                     const std::vector<char>& decided, std::vector<char>& used) {
  const double limit = chi_squared_6(config.inlier_probability);
  const std::size_t known = std::min(decided.size(), used.size());
  std::vector<char> kept(used);
  for (std::size_t i = 0; i < kept.size(); ++i)
    kept[i] = i < known ? static_cast<char>(used[i] & decided[i]) : 0;
  const gtsam::NonlinearFactorGraph without_new = build_graph(problem, kept);
  Solved solved = solve_plain(without_new, first, config);
  const double cost_without = without_new.error(solved.values);
  const Solved without = solved;
  std::size_t added = 0;
  for (std::size_t i = known; i < kept.size(); ++i) {
    kept[i] = used[i];
    added += used[i] != 0 ? 1 : 0;
  }
  if (added > 0) {
    const gtsam::NonlinearFactorGraph with_new = build_graph(problem, kept);
    solved = solve_plain(with_new, without.values, config);
    const double gained = with_new.error(solved.values) - cost_without;
    if (gained > 0.5 * limit * static_cast<double>(added)) {
      if (added > kMostChanges) return std::nullopt;
      solved = add_singly(problem, without, config, known, kept);
    }
  }
  bool changed = false;
  for (int turn = 0; turn <= kTurnsToAgree; ++turn) {
    if (changed) solved = solve_plain(build_graph(problem, kept), solved.values, config);
    const std::vector<double> distances = loop_distances(problem, solved.values);
    std::size_t changes = 0;
    for (std::size_t i = 0; i < kept.size(); ++i) {
      const char within = used[i] != 0 && distances[i] < limit ? 1 : 0;
      changes += within != kept[i] ? 1 : 0;
      kept[i] = within;
    }
    if (changes == 0) {
      used = std::move(kept);
      return solved;
    }
    if (changes > kMostChanges) return std::nullopt;
    changed = true;
  }
  return std::nullopt;
}

}  // namespace

PoseGraphResult optimise_pose_graph(const PoseGraphProblem& problem, const PoseGraphConfig& config,
                                    LoopAgreement* agreement, const std::vector<char>& decided) {
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
    std::optional<Solved> kept;
    if (config.robust_loops && decided.size() >= kFewLoops)
      kept = keep_decisions(problem, first, config, decided, result.loop_used);
    if (config.robust_loops && !problem.loops.empty() && !kept)
      reject_by_gnc(problem, first, config, result.loop_used);
    const Solved solved = kept ? std::move(*kept)
                               : solve_plain(build_graph(problem, result.loop_used), first, config);
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
