#include "understory/graph/self_correction/stem_correction.h"

#include <algorithm>
#include <cmath>

#include "understory/graph/graph_constants.h"
#include "understory/registration/stems/tilt_about.h"
#include "understory/util/angles.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using namespace graph_constants::stem_correction;

// The views turned level by their own stems.
struct LevelViews {
  std::vector<SparsePoints> points;
  std::vector<Pose> level_from_body;
  std::vector<Pose> world_from_level;
  std::vector<StemUp> ups;
};

LevelViews level(const std::vector<StemView>& views, const std::vector<SparseStep>& steps) {
  LevelViews result;
  result.points.resize(views.size());
  result.level_from_body.resize(views.size());
  result.world_from_level.resize(views.size());
  result.ups.resize(views.size());
  parallel_for(views.size(), 16, [&](std::size_t i) {
    // The front end may have known more of up than the stems.
    result.ups[i] =
        steps[i].up.sd_rad > 0.0 ? steps[i].up : stem_up(views[i], steps[i].up.up_in_body);
    const Eigen::Quaterniond turn = understory::level_from_body(result.ups[i]);
    result.points[i] = stem_points(views[i], turn);
    result.level_from_body[i] = Pose(turn, Eigen::Vector3d::Zero());
    result.world_from_level[i] = steps[i].world_from_body * result.level_from_body[i].inverse();
  });
  return result;
}

// Of a step: what matching says, and what both views got wrong alike, which it cannot know: a
// hundredth of the way. Tilt comes below.
Matrix6d odometry_covariance(const SparseStep& step, const Pose& previous_from_body) {
  const double shift = kStepShift + kStepShiftShare * previous_from_body.translation().norm();
  Matrix6d covariance = step.covariance;
  covariance.diagonal() +=
      (Vector6d() << 0.0, 0.0, kStepYaw * kStepYaw, shift * shift, shift * shift, shift * shift)
          .finished();
  // Little overlap may be the view's fault and the match still be right; without a match there is
  // nothing but the last motion.
  if (step.status == SparseStepStatus::kWeak) {
    covariance.diagonal().head<3>().array() += kWeakTilt * kWeakTilt;
    covariance.diagonal().tail<3>().array() += kWeakShift * kWeakShift;
  }
  if (step.status == SparseStepStatus::kUnmatched) covariance += Matrix6d::Identity();
  return covariance;
}

// Views within that part of the way of each view, itself included.
std::vector<int> neighbours_on_the_way(const std::vector<Pose>& poses, double reach_m) {
  std::vector<double> way(poses.size(), 0.0);
  for (std::size_t i = 1; i < poses.size(); ++i)
    way[i] = way[i - 1] + (poses[i].translation() - poses[i - 1].translation()).norm();
  std::vector<int> counts;
  for (std::size_t i = 0; i < way.size(); ++i) {
    const auto first = std::lower_bound(way.begin(), way.end(), way[i] - reach_m);
    const auto last = std::upper_bound(way.begin(), way.end(), way[i] + reach_m);
    counts.push_back(static_cast<int>(last - first));
  }
  return counts;
}

// A view has been turned level by its stems. As many views see the same trees, which lean as they
// do, they know together no more of up than one of them.
std::vector<TiltPrior> tilts_of(const LevelViews& level) {
  const std::vector<int> sharing = neighbours_on_the_way(level.world_from_level, kSameTrees);
  std::vector<TiltPrior> tilts;
  for (std::size_t i = 0; i < level.ups.size(); ++i) {
    const StemUp& up = level.ups[i];
    if (up.stems == 0) continue;
    const double one =
        up.sd_rad > 0.0 ? up.sd_rad : std::hypot(kStandLeans, up.spread_rad / std::sqrt(up.stems));
    tilts.push_back({static_cast<int>(i), Eigen::Vector3d::UnitZ(), one * std::sqrt(sharing[i])});
  }
  return tilts;
}

// In level frames, with loops not looked for yet.
SelfCorrectionProblem problem_of(LevelViews& level, const std::vector<SparseStep>& steps) {
  SelfCorrectionProblem problem;
  problem.views = std::move(level.points);
  problem.world_from_view = level.world_from_level;
  problem.tilts = tilts_of(level);
  for (std::size_t i = 0; i < steps.size(); ++i) {
    problem.steps.emplace_back();
    problem.step_errors.push_back(steps[i].error_m);
    problem.step_covariances.push_back(Matrix6d::Identity());
    if (i == 0) continue;
    problem.steps[i] = level.world_from_level[i - 1].inverse() * level.world_from_level[i];
    const Pose body_step = steps[i - 1].world_from_body.inverse() * steps[i].world_from_body;
    problem.step_covariances[i] =
        compose_covariance(odometry_covariance(steps[i], body_step),
                           level.level_from_body[i].inverse(), Matrix6d::Zero());
    // The odometry holds the tilt as if the body turned about a point among the feet below it.
    const Eigen::Vector3d below(0.0, 0.0, middle_of(problem.views[i]).z());
    problem.step_covariances[i] += tilt_about(below, kStepTilt);
  }
  return problem;
}

// Loops over the odometry; leaves the poses and the accepted loops in the problem.
void close_loops(const StemCorrectionConfig& config, const ProgressSink& progress,
                 SelfCorrectionProblem& problem, StemCorrection& result) {
  result.loops = find_stem_loops({problem.views, problem.world_from_view, problem.step_covariances},
                                 config.loops, progress);
  result.accepted.assign(result.loops.size(), 0);
  result.loop_shift_m.assign(result.loops.size(), 0.0);
  PoseGraphProblem graph = chain_problem(problem, problem.world_from_view);
  std::vector<std::size_t> rows;
  for (std::size_t k = 0; k < result.loops.size(); ++k) {
    const StemLoop& loop = result.loops[k];
    if (!loop.verified) continue;
    rows.push_back(k);
    const Pose chained = problem.world_from_view[static_cast<std::size_t>(loop.match)].inverse() *
                         problem.world_from_view[static_cast<std::size_t>(loop.query)];
    result.loop_shift_m[k] = (loop.match_from_query.translation() - chained.translation()).norm();
    graph.loops.push_back({loop.match, loop.query, loop.match_from_query, loop.covariance});
  }
  if (graph.loops.empty()) return;
  const PoseGraphResult solved = optimise_pose_graph(graph, config.graph);
  result.converged = solved.converged;
  result.reason = solved.reason;
  problem.world_from_view = solved.world_from_keyframe;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    result.accepted[rows[k]] = solved.loop_used[k];
    if (solved.loop_used[k] != 0) problem.loops.push_back(graph.loops[k]);
  }
}

}  // namespace

void describe(ConfigTable& table, StemCorrectionConfig& config) {
  table.add("close_loops", config.close_loops,
            "find places seen before and correct the path by them");
  table.section("loops", [&] { describe(table, config.loops); });
  table.section("pose_graph", [&] { describe(table, config.graph); });
  table.section("map", [&] { describe(table, config.map); });
  table.section("correction", [&] { describe(table, config.correction); });
}

StemCorrection correct_stems(const std::vector<StemView>& views,
                             const std::vector<SparseStep>& steps,
                             const StemCorrectionConfig& config, StageTimes& times,
                             const ProgressSink& progress) {
  LevelViews leveled = level(views, steps);
  SelfCorrectionProblem problem = problem_of(leveled, steps);
  const std::vector<StemView> sights = map_sights(views, config.map);
  for (std::size_t i = 0; i < views.size(); ++i)
    problem.map_views.push_back(stem_points(sights[i], leveled.level_from_body[i].rotation()));
  StemCorrection result;
  if (config.close_loops) {
    const ScopedTimer timer(times, "loops");
    close_loops(config, progress, problem, result);
  }
  {
    const ScopedTimer timer(times, "self_correction");
    result.self = self_correct(problem, config.correction, progress);
  }
  for (std::size_t i = 0; i < views.size(); ++i)
    result.world_from_body.push_back(result.self.world_from_view[i] * leveled.level_from_body[i]);
  return result;
}

MapSharpness stem_sharpness(const std::vector<StemView>& views,
                            const std::vector<Pose>& world_from_body,
                            const SharpnessConfig& config) {
  std::vector<SparsePoints> points;
  for (const StemView& view : views)
    points.push_back(stem_points(view, Eigen::Quaterniond::Identity()));
  return map_sharpness(points, world_from_body, {}, config);
}

}  // namespace understory
