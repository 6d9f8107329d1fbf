#include <algorithm>
#include <cmath>
#include <cstdio>

#include "understory/graph/graph_constants.h"
#include "understory/graph/self_correction/correction_methods.h"
#include "understory/graph/self_correction/path_process.h"
#include "understory/graph/stem_matching/pair_matching.h"
#include "understory/util/index.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using namespace graph_constants::gaussian_correction;

// Of a step on average, diagonal. The views' frames and the world are level, and views look every
// way, so what is in the plane is alike along and across.
Vector6d mean_variances(const std::vector<Matrix6d>& covariances) {
  Vector6d sum = Vector6d::Constant(1e-12);
  for (std::size_t k = 1; k < covariances.size(); ++k)
    sum += covariances[k].diagonal() / static_cast<double>(covariances.size() - 1);
  sum.head<2>().setConstant(0.5 * (sum[0] + sum[1]));
  sum.segment<2>(3).setConstant(0.5 * (sum[3] + sum[4]));
  return sum;
}

// Loops are in the poses already. The regression takes them as observations as well.
std::vector<PathObservation> observed_loops(const std::vector<PoseEdge>& loops) {
  const std::size_t count = std::min(loops.size(), kMostLoops);
  std::vector<PathObservation> result;
  for (std::size_t k = 0; k < count; ++k) {
    const PoseEdge& loop = loops[k * loops.size() / count];
    if (loop.from < loop.to)
      result.push_back({loop.from, loop.to, loop.from_from_to, loop.covariance});
  }
  return result;
}

std::string account_of(const PathProcessResult& regressed) {
  char text[160];
  std::snprintf(text, sizeof text,
                "the path was regressed over the matches; errors of its steps are correlated over "
                "%.0f views and %.2f times as large as stated",
                regressed.length_views, regressed.scale);
  return text;
}

}  // namespace

void correct_by_gaussian_process(const CorrectionViews& views, const SelfCorrectionConfig& config,
                                 SelfCorrectionResult& result) {
  const std::vector<CorrectionPair> pairs = chosen_pairs(views, config, result);
  const std::vector<Pose>& first = views.problem.world_from_view;
  const Vector6d variances = mean_variances(views.problem.step_covariances);
  const std::vector<PathObservation> loops = observed_loops(views.problem.loops);
  std::vector<Pose> poses = first;
  std::vector<PairMatch> accepted(pairs.size());
  result.stopped_because = "no pair could be matched";
  // Matched from where they are, regressed, and matched again from there.
  constexpr int kRounds = 2;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<PairMatch> matches(pairs.size());
    parallel_for(pairs.size(), 1, [&](std::size_t k) {
      views.progress.poll();
      const CorrectionPair& pair = pairs[k];
      matches[k] =
          match_pair(views.targets[at(pair.j)], views.problem.views[at(pair.i)],
                     poses[at(pair.j)].inverse() * poses[at(pair.i)], views.overlap, config);
    });
    std::vector<PathObservation> observations = loops;
    std::vector<std::size_t> rows;
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      if (round == 0) result.tried.push_back(tried_correction(pairs[k], matches[k], first));
      // A match that finds nothing to mend the second time leaves what the first one said.
      if (matches[k].accepted) accepted[k] = matches[k];
      if (!accepted[k].accepted) continue;
      result.tried[k].accepted = true;
      rows.push_back(k);
      observations.push_back(
          {pairs[k].j, pairs[k].i, accepted[k].j_from_i, accepted[k].covariance});
    }
    if (rows.empty()) return;
    const PathProcessResult regressed = regress_path(first, variances, observations, {});
    poses = regressed.world_from_view;
    if (blurs(views, first, poses, config) || blurs(views, result.world_from_view, poses, config)) {
      if (round == 0) result.stopped_because = "the map would have become blurrier";
      continue;
    }
    result.world_from_view = poses;
    result.stopped_because = account_of(regressed);
    for (std::size_t k = 0; k < rows.size(); ++k) {
      TriedCorrection& tried = result.tried[rows[k]];
      tried.kept = regressed.used[loops.size() + k] != 0;
      tried.reason = tried.kept ? "" : "contradicts the others";
    }
  }
}

}  // namespace understory
