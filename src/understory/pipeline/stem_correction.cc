#include "understory/pipeline/stem_correction.h"

#include <algorithm>
#include <cmath>

#include "understory/util/parallel.h"

namespace understory {
namespace {

// Of a step: what matching says, and what both views got wrong alike, which it cannot know: a
// hundredth of the way, and the tilt that the stems' axes hold.
Matrix6d odometry_covariance(const SparseStep& step, const Pose& previous_from_body) {
  const double tilt = 0.5 * M_PI / 180.0;
  const double yaw = 0.02 * M_PI / 180.0;
  const double shift = 0.005 + 0.01 * previous_from_body.translation().norm();
  Matrix6d covariance = step.covariance;
  covariance.diagonal() += (Vector6d() << tilt * tilt, tilt * tilt, yaw * yaw, shift * shift,
                            shift * shift, shift * shift)
                               .finished();
  if (step.status == SparseStepStatus::kWeak || step.status == SparseStepStatus::kUnmatched)
    covariance += Matrix6d::Identity();
  return covariance;
}

}  // namespace

StemCorrection close_stem_loops(const std::vector<StemView>& views,
                                const std::vector<SparseStep>& steps, const StemLoopConfig& loops,
                                const PoseGraphConfig& graph) {
  std::vector<SparsePoints> level_views(views.size());
  std::vector<Pose> level_from_body(views.size());
  std::vector<Pose> world_from_level(views.size());
  parallel_for(views.size(), 16, [&](std::size_t i) {
    const Eigen::Quaterniond level = understory::level_from_body(stem_up(views[i]));
    level_views[i] = stem_points(views[i], level);
    level_from_body[i] = Pose(level, Eigen::Vector3d::Zero());
    world_from_level[i] = steps[i].world_from_body * level_from_body[i].inverse();
  });
  StemCorrection result;
  result.loops = find_stem_loops(level_views, world_from_level, loops);
  PoseGraphProblem problem;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    problem.world_from_keyframe.push_back(steps[i].world_from_body);
    if (i == 0) continue;
    const Pose step = steps[i - 1].world_from_body.inverse() * steps[i].world_from_body;
    problem.odometry.push_back(
        {static_cast<int>(i) - 1, static_cast<int>(i), step, odometry_covariance(steps[i], step)});
  }
  std::vector<std::size_t> rows;
  for (std::size_t k = 0; k < result.loops.size(); ++k) {
    const StemLoop& loop = result.loops[k];
    if (!loop.verified) continue;
    rows.push_back(k);
    const Pose& body = level_from_body[static_cast<std::size_t>(loop.query)];
    const Pose& match = level_from_body[static_cast<std::size_t>(loop.match)];
    problem.loops.push_back({loop.match, loop.query, match.inverse() * loop.match_from_query * body,
                             compose_covariance(loop.covariance, body, Matrix6d::Zero())});
  }
  result.accepted.assign(result.loops.size(), 0);
  result.world_from_body = problem.world_from_keyframe;
  if (problem.loops.empty()) return result;
  PoseGraphResult solved = optimise_pose_graph(problem, graph);
  result.converged = solved.converged;
  result.reason = solved.reason;
  result.world_from_body = std::move(solved.world_from_keyframe);
  for (std::size_t k = 0; k < rows.size(); ++k)
    result.accepted[rows[k]] = solved.loop_used[k];
  return result;
}

}  // namespace understory
