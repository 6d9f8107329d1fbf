#include <algorithm>
#include <cmath>

#include "understory/graph/graph_constants.h"
#include "understory/graph/loops/gain_queue.h"
#include "understory/graph/self_correction/correction_methods.h"
#include "understory/graph/stem_matching/pair_matching.h"
#include "understory/util/index.h"
#include "understory/util/median.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using namespace graph_constants::expected_gain;

struct Accepted {
  std::size_t row;  // of result.tried
  PoseEdge edge;
  bool used = true;
};

class GainCorrection {
 public:
  GainCorrection(const CorrectionViews& views, const SelfCorrectionConfig& config,
                 SelfCorrectionResult& result)
      : views_(views),
        config_(config),
        result_(result),
        all_around_({views.overlap.cone().range_m, M_PI}),
        poses_(result.world_from_view) {
    chain_.push_back(poses_.front());
    walked_m2_.push_back(0.0);
    const std::vector<double> variances = plane_variances_m2(views);
    for (std::size_t k = 1; k < poses_.size(); ++k) {
      chain_.push_back(chain_.back() * views.problem.steps[k]);
      walked_m2_.push_back(walked_m2_.back() + variances[k]);
    }
  }

  void run() {
    GainQueue queue = make_queue();
    const auto budget =
        static_cast<int>(config_.largest_share * static_cast<double>(views_.targets.size()));
    std::size_t next_solve = 4;
    result_.stopped_because = "no pair has a larger expected gain";
    while (static_cast<int>(accepted_.size()) < budget) {
      const auto best = queue.best();
      if (!best || queue.gain(*best) < config_.gain.min_gain) break;
      if (!try_pair(queue, *best)) {
        queue.drop(*best);
        if (static_cast<int>(result_.tried.size()) > 4 * budget) break;
        continue;
      }
      queue.take(*best);
      if (accepted_.size() < next_solve) continue;
      solve();
      next_solve *= 2;
    }
    if (static_cast<int>(accepted_.size()) >= budget)
      result_.stopped_because = "the largest number of corrections was reached";
    solve();
    for (int round = 0; round < config_.gain.revisits && !accepted_.empty(); ++round) {
      revisit();
      solve();
    }
    finish();
  }

 private:
  // Pairs with overlapping sectors; (27) is not asked of them, as it is the ones that do not fit
  // yet that tell most.
  [[nodiscard]] GainQueue make_queue() {
    PairConfig pairs = config_.pairs;
    pairs.error_m = 1e9;
    pairs.longest_gap = 0;
    const auto seed = static_cast<std::uint64_t>(config_.seed);
    std::vector<CorrectionPair> pool =
        promising_pairs(views_.targets, poses_, views_.overlap, pairs, seed);
    result_.promising = pool.size();
    pool = poisson_disk_choice(pool, config_.gain.pool);
    std::vector<double> noise = match_variances_m2(pool, config_.gain.match_sd_m);
    return {std::move(pool), std::move(noise), plane_variances_m2(views_)};
  }

  [[nodiscard]] SparsePoints gathered(int centre) const {
    return gather_views(
        views_.problem.views, poses_, centre,
        {config_.gain.window_l0 * views_.l0_m, config_.gain.window_views, kGatherL0 * views_.l0_m});
  }

  [[nodiscard]] PairMatch match(const CorrectionPair& pair) const {
    views_.progress.poll();
    const SparseTarget target(gathered(pair.j));
    const SparsePoints source = gathered(pair.i);
    const Pose guess = poses_[at(pair.j)].inverse() * poses_[at(pair.i)];
    PairMatch match;
    match.error_before_m =
        placed_error(target, source, guess, all_around_, config_.pairs.outlier_ratio);
    const SparseIcpResult icp = register_sparse_icp(target, source, guess, config_.icp);
    match.j_from_i = icp.target_from_source;
    match.error_m =
        placed_error(target, source, match.j_from_i, all_around_, config_.pairs.outlier_ratio);
    match.overlap = icp.overlap;
    match.outlier_ratio = icp.outlier_ratio;
    match.covariance = match_covariance(icp.information, source, config_.gain.match_sd_m);
    const double moved = (match.j_from_i.translation() - guess.translation()).head<2>().norm();
    if (icp.status == SparseIcpStatus::kTooFewPoints) {
      match.reason = icp.reason;
    } else if (icp.overlap < config_.min_final_overlap) {
      match.reason = "too few stems found a partner";
    } else if (moved > config_.gain.largest_step_l0 * views_.l0_m) {
      match.reason = "too far from where the views were";
    } else {
      match.accepted = true;
    }
    return match;
  }

  bool try_pair(const GainQueue& queue, std::size_t index) {
    const CorrectionPair& pair = queue.pair(index);
    const PairMatch found = match(pair);
    TriedCorrection tried;
    tried.pair = pair;
    tried.expected_gain = queue.gain(index);
    tell(found, tried);
    result_.tried.push_back(tried);
    if (!found.accepted) return false;
    accepted_.push_back(
        {result_.tried.size() - 1, {pair.j, pair.i, found.j_from_i, found.covariance}});
    return true;
  }

  void tell(const PairMatch& match, TriedCorrection& tried) const {
    const Pose before = poses_[at(tried.pair.j)].inverse() * poses_[at(tried.pair.i)];
    tried.error_before_m = match.error_before_m;
    tried.error_after_m = match.error_m;
    tried.overlap_after = match.overlap;
    tried.moved_m = (match.j_from_i.translation() - before.translation()).head<2>().norm();
    tried.accepted = match.accepted;
    tried.reason = match.reason;
  }

  // By what factor the variance of the odometry differs from what it says, from what the matches
  // moved of its own chain. Twice the squared shift over the variance is chi squared with 2 degrees
  // of freedom, whose median is 2 ln 2. Else the solver would take right matches for wrong ones.
  [[nodiscard]] double odometry_variance_scale() const {
    constexpr double kMedian = 0.6931471805599453;
    std::vector<double> ratios;
    for (const Accepted& accepted : accepted_) {
      const PoseEdge& edge = accepted.edge;
      const Pose chained = chain_[at(edge.from)].inverse() * chain_[at(edge.to)];
      const double squared =
          (edge.from_from_to.translation() - chained.translation()).head<2>().squaredNorm();
      const double expected = walked_m2_[at(edge.to)] - walked_m2_[at(edge.from)];
      ratios.push_back(squared / (kMedian * std::max(expected, 1e-12)));
    }
    return std::clamp(upper_median(ratios, 1.0), kLeastScale, kMostScale);
  }

  // All accepted pairs at once with the odometry. Keeps the poses unless they blur the map, against
  // the poses kept so far or those that the correction began with.
  void solve() {
    PoseGraphProblem graph = chain_problem(views_.problem, poses_);
    graph.loops = views_.problem.loops;
    const std::size_t given = graph.loops.size();
    // What the matches moved in the plane says nothing about heights and tilt.
    const double scale = std::sqrt(odometry_variance_scale());
    const Vector6d stretch = (Vector6d() << 1.0, 1.0, scale, scale, scale, 1.0).finished();
    for (PoseEdge& edge : graph.odometry)
      edge.covariance = stretch.asDiagonal() * edge.covariance * stretch.asDiagonal();
    for (const Accepted& accepted : accepted_)
      graph.loops.push_back(accepted.edge);
    if (graph.loops.empty()) return;
    PoseGraphConfig solver;
    solver.check_consistency = false;  // the gate on each match is the narrower one
    const PoseGraphResult solved = optimise_pose_graph(graph, solver);
    if (!solved.reason.empty() && !solved.converged) {
      result_.stopped_because = solved.reason;
      return;
    }
    poses_ = solved.world_from_keyframe;
    for (std::size_t k = 0; k < accepted_.size(); ++k)
      accepted_[k].used = solved.loop_used[given + k] != 0;
    if (blurs(views_, views_.problem.world_from_view, poses_, config_) ||
        blurs(views_, result_.world_from_view, poses_, config_)) {
      return;
    }
    result_.world_from_view = poses_;
    kept_.clear();
    for (const Accepted& accepted : accepted_) {
      if (accepted.used) kept_.push_back(accepted.row);
    }
  }

  // The accepted pairs once more, from the better poses and with better gathered views.
  void revisit() {
    std::vector<PairMatch> matches(accepted_.size());
    parallel_for(accepted_.size(), 1,
                 [&](std::size_t k) { matches[k] = match(result_.tried[accepted_[k].row].pair); });
    std::vector<Accepted> still;
    for (std::size_t k = 0; k < accepted_.size(); ++k) {
      if (!matches[k].accepted) continue;
      Accepted accepted = accepted_[k];
      accepted.edge.from_from_to = matches[k].j_from_i;
      accepted.edge.covariance = matches[k].covariance;
      still.push_back(accepted);
    }
    accepted_ = std::move(still);
  }

  void finish() {
    for (const std::size_t row : kept_)
      result_.tried[row].kept = true;
    for (TriedCorrection& tried : result_.tried) {
      if (tried.accepted && !tried.kept) tried.reason = "contradicts the others";
    }
  }

  const CorrectionViews& views_;
  const SelfCorrectionConfig& config_;
  SelfCorrectionResult& result_;
  ConeOverlap all_around_;
  std::vector<Pose> poses_;
  std::vector<Pose> chain_;        // the odometry's own poses
  std::vector<double> walked_m2_;  // its variance up to each view
  std::vector<Accepted> accepted_;
  std::vector<std::size_t> kept_;
};

}  // namespace

void correct_by_expected_gain(const CorrectionViews& views, const SelfCorrectionConfig& config,
                              SelfCorrectionResult& result) {
  GainCorrection(views, config, result).run();
}

}  // namespace understory
