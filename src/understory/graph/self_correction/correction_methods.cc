#include "understory/graph/self_correction/correction_methods.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "understory/graph/graph_constants.h"
#include "understory/graph/loops/gain_queue.h"
#include "understory/graph/stem_matching/pair_matching.h"
#include "understory/graph/stem_matching/star_association.h"
#include "understory/util/index.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using namespace graph_constants::correction_methods;

// Applies one correction after the other and ends with the sharpest map on the way. The paper asks
// for this stop rule in its section 4.
class PowerChain {
 public:
  PowerChain(const CorrectionViews& views, const SelfCorrectionConfig& config,
             const PowerConfig& power, SelfCorrectionResult& result)
      : views_(views),
        config_(config),
        power_(power),
        result_(result),
        poses_(result.world_from_view),
        min_beta_(beta_of(views, poses_, config)) {}

  // False: no sharper map for longer than patience allows.
  template <typename Match>
  [[nodiscard]] bool add(const CorrectionPair& pair, const Match& match_views) {
    views_.progress.poll();
    const PairMatch match =
        match_views(views_.targets[at(pair.j)], views_.problem.views[at(pair.i)],
                    poses_[at(pair.j)].inverse() * poses_[at(pair.i)], views_.overlap, config_);
    TriedCorrection tried = tried_correction(pair, match, poses_);
    if (match.accepted) {
      apply_power_correction(poses_, views_.problem.step_errors, pair.j, pair.i, match.j_from_i,
                             power_);
      tried.beta = beta_of(views_, poses_, config_);
      ++accepted_;
      ++since_best_;
    }
    result_.tried.push_back(tried);
    if (match.accepted && tried.beta < min_beta_) {
      min_beta_ = tried.beta;
      since_best_ = 0;
      result_.world_from_view = poses_;
      best_length_ = result_.tried.size();
    }
    return since_best_ < config_.patience;
  }

  [[nodiscard]] int accepted() const { return accepted_; }

  void finish(const std::string& reason) {
    result_.stopped_because = reason;
    for (std::size_t k = 0; k < result_.tried.size(); ++k) {
      TriedCorrection& tried = result_.tried[k];
      tried.kept = tried.accepted && k < best_length_;
      if (tried.accepted && !tried.kept) tried.reason = "the map did not become sharper by it";
    }
  }

 private:
  const CorrectionViews& views_;
  const SelfCorrectionConfig& config_;
  const PowerConfig& power_;
  SelfCorrectionResult& result_;
  std::vector<Pose> poses_;
  double min_beta_;
  int since_best_ = 0;
  int accepted_ = 0;
  std::size_t best_length_ = 0;
};

// As many as `most` pairs: first the one that tells most, then the one that tells most beside it,
// and so on.
std::vector<CorrectionPair> by_gain(const CorrectionViews& views, std::vector<CorrectionPair> pairs,
                                    std::vector<double> noise, std::size_t most) {
  GainQueue queue(std::move(pairs), std::move(noise), plane_variances_m2(views));
  std::vector<CorrectionPair> result;
  while (const auto best = result.size() < most ? queue.best() : std::nullopt) {
    result.push_back(queue.pair(*best));
    queue.take(*best);
  }
  return result;
}

// Pairs whose sectors overlap, by what the association of their stems' stars lets expect. (27) is
// not asked of them: pairs that do not fit yet tell most.
std::vector<CorrectionPair> by_stars(const CorrectionViews& views,
                                     const SelfCorrectionConfig& config,
                                     SelfCorrectionResult& result) {
  PairConfig drawn = config.pairs;
  drawn.error_m = 1e9;
  const std::vector<Pose>& poses = result.world_from_view;
  std::vector<CorrectionPair> pool = promising_pairs(views.targets, poses, views.overlap, drawn,
                                                     static_cast<std::uint64_t>(config.seed));
  result.promising = pool.size();
  pool = poisson_disk_choice(pool, config.gain.pool);
  std::vector<StarView> stars(poses.size());
  parallel_for(stars.size(), 16,
               [&](std::size_t k) { stars[k] = stars_of(views.problem.views[k]); });
  const std::vector<double> variances = plane_variances_m2(views);
  std::vector<double> walked(variances.size(), 0.0);
  std::partial_sum(variances.begin(), variances.end(), walked.begin());
  std::vector<double> noise(pool.size());
  const StarNoise stem;
  parallel_for(pool.size(), 16, [&](std::size_t k) {
    const CorrectionPair& pair = pool[k];
    const double known = associated_stems(stars[at(pair.j)], stars[at(pair.i)],
                                          poses[at(pair.j)].inverse() * poses[at(pair.i)],
                                          0.5 * (walked[at(pair.i)] - walked[at(pair.j)]), stem);
    // A match has three unknowns in the plane; where hardly any partner is known it tells nothing.
    const double spare = std::max(known - 3.0, 1e-3);
    noise[k] = config.gain.match_sd_m * config.gain.match_sd_m +
               4.0 * stem.stem_sd_m * stem.stem_sd_m / spare;
  });
  const auto most =
      static_cast<std::size_t>(std::max(1, correction_budget(views.targets.size(), config)));
  return by_gain(views, std::move(pool), std::move(noise), most);
}

}  // namespace

double beta_of(const CorrectionViews& views, const std::vector<Pose>& poses,
               const SelfCorrectionConfig& config) {
  return blur_ratio(map_points(views.problem.map_views, poses, {}), config.sharpness);
}

bool blurs(const CorrectionViews& views, const std::vector<Pose>& before,
           const std::vector<Pose>& after, const SelfCorrectionConfig& config) {
  const BlurChange change =
      blur_change(map_points(views.problem.map_views, before, {}),
                  map_points(views.problem.map_views, after, {}), config.sharpness);
  return change.deviations > config.blurrier_sd;
}

TriedCorrection tried_correction(const CorrectionPair& pair, const PairMatch& match,
                                 const std::vector<Pose>& poses) {
  TriedCorrection tried;
  tried.pair = pair;
  tried.error_before_m = match.error_before_m;
  tried.error_after_m = match.error_m;
  tried.overlap_after = match.overlap;
  tried.by_go_icp = match.by_go_icp;
  tried.accepted = match.accepted;
  tried.reason = match.reason;
  const Pose before = poses[at(pair.j)].inverse() * poses[at(pair.i)];
  tried.moved_m = (match.j_from_i.translation() - before.translation()).head<2>().norm();
  return tried;
}

std::vector<CorrectionPair> chosen_pairs(const CorrectionViews& views,
                                         const SelfCorrectionConfig& config,
                                         SelfCorrectionResult& result) {
  const auto seed = static_cast<std::uint64_t>(config.seed);
  if (config.pairs.rule == PairRule::kDelaunayStars) return by_stars(views, config, result);
  const std::vector<CorrectionPair> promising =
      promising_pairs(views.targets, result.world_from_view, views.overlap, config.pairs, seed);
  result.promising = promising.size();
  std::vector<CorrectionPair> chosen =
      poisson_disk_choice(promising, std::max(1, correction_budget(views.targets.size(), config)));
  if (config.order == CorrectionOrder::kGain) {
    std::vector<double> noise = match_variances_m2(chosen, config.gain.match_sd_m);
    const std::size_t all = chosen.size();
    return by_gain(views, std::move(chosen), std::move(noise), all);
  }
  return ordered(std::move(chosen), config.order, seed);
}

std::vector<double> plane_variances_m2(const CorrectionViews& views) {
  const double arm = 0.5 * views.overlap.cone().range_m;
  std::vector<double> variances;
  for (const Matrix6d& c : views.problem.step_covariances)
    variances.push_back(c(3, 3) + c(4, 4) + arm * arm * c(2, 2));
  return variances;
}

std::vector<double> match_variances_m2(const std::vector<CorrectionPair>& pairs, double sd_m) {
  std::vector<double> variances;
  for (const CorrectionPair& pair : pairs)
    variances.push_back(sd_m * sd_m / std::max(pair.overlap, kLeastOverlap));
  return variances;
}

void correct_by_powers(const CorrectionViews& views, const SelfCorrectionConfig& config,
                       SelfCorrectionResult& result) {
  PowerConfig power = config.power;
  power.form = config.method == CorrectionMethod::kPowersPrinted ? PowerForm::kPrinted
                                                                 : PowerForm::kCorrected;
  const int budget = correction_budget(views.targets.size(), config);
  const std::vector<CorrectionPair> pairs = chosen_pairs(views, config, result);
  PowerChain chain(views, config, power, result);
  for (const CorrectionPair& pair : pairs) {
    if (chain.accepted() >= budget)
      return chain.finish("the largest number of corrections was reached");
    if (!chain.add(pair, match_pair)) return chain.finish("the map did not become sharper");
  }
  chain.finish("all chosen pairs were tried");
}

void correct_by_lattice(const CorrectionViews& views, const SelfCorrectionConfig& config,
                        SelfCorrectionResult& result) {
  PowerConfig power = config.power;
  power.coefficient = PowerCoefficient::kMatchError;  // P1 (5)
  const std::vector<CorrectionPair> pairs = lattice_pairs(
      static_cast<int>(views.targets.size()), config.lattice.spacing, config.lattice.longest_gap);
  result.promising = pairs.size();
  PowerChain chain(views, config, power, result);
  for (const CorrectionPair& pair : pairs) {
    const double overlap =
        views.overlap(result.world_from_view[at(pair.i)], result.world_from_view[at(pair.j)]);
    // Views that share nothing cannot be matched: no search is spent on them.
    if (overlap <= 0.0) continue;
    (void)chain.add(pair, match_lattice_pair);
  }
  chain.finish("all pairs of the lattice were tried");
}

void correct_by_pose_graph(const CorrectionViews& views, const SelfCorrectionConfig& config,
                           SelfCorrectionResult& result) {
  const std::vector<CorrectionPair> pairs = chosen_pairs(views, config, result);
  const std::vector<Pose>& poses = views.problem.world_from_view;
  std::vector<PairMatch> matches(pairs.size());
  parallel_for(pairs.size(), 1, [&](std::size_t k) {
    views.progress.poll();
    const CorrectionPair& pair = pairs[k];
    matches[k] = match_pair(views.targets[at(pair.j)], views.problem.views[at(pair.i)],
                            poses[at(pair.j)].inverse() * poses[at(pair.i)], views.overlap, config);
  });
  PoseGraphProblem graph = chain_problem(views.problem, poses);
  graph.loops = views.problem.loops;
  std::vector<std::size_t> rows;
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    result.tried.push_back(tried_correction(pairs[k], matches[k], poses));
    if (!matches[k].accepted) continue;
    rows.push_back(k);
    graph.loops.push_back({pairs[k].j, pairs[k].i, matches[k].j_from_i, matches[k].covariance});
  }
  const PoseGraphResult solved = optimise_pose_graph(graph, {});
  result.stopped_because = solved.converged ? "solved at once" : solved.reason;
  if (blurs(views, poses, solved.world_from_keyframe, config)) {
    result.stopped_because = "the map would have become blurrier";
    return;
  }
  result.world_from_view = solved.world_from_keyframe;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    TriedCorrection& tried = result.tried[rows[k]];
    tried.kept = solved.loop_used[views.problem.loops.size() + k] != 0;
    if (!tried.kept) tried.reason = "contradicts the others";
  }
}

}  // namespace understory
