#pragma once

#include <vector>

#include "understory/graph/loops/view_cone.h"
#include "understory/graph/self_correction/self_correction.h"
#include "understory/graph/stem_matching/pair_matching.h"
#include "understory/util/progress.h"

namespace understory {

// What the methods of self_correct share.
struct CorrectionViews {
  CorrectionViews(const SelfCorrectionProblem& problem, const ProgressSink& progress);

  const SelfCorrectionProblem& problem;
  const ProgressSink& progress;  // polled before each match
  std::vector<SparseTarget> targets;
  ConeOverlap overlap;
  double l0_m = 0.0;  // median over the views
};

// Corrections that may be added, of `views` views.
[[nodiscard]] int correction_budget(std::size_t views, const SelfCorrectionConfig& config);

// Of the odometry's steps, in the plane; a turn counts by what it moves half way to the edge of the
// view.
[[nodiscard]] std::vector<double> plane_variances_m2(const CorrectionViews& views);
// Of a match of the pair, `sd_m` being that of one with full overlap.
[[nodiscard]] std::vector<double> match_variances_m2(const std::vector<CorrectionPair>& pairs,
                                                     double sd_m);

// Of the map that the poses make.
[[nodiscard]] double beta_of(const CorrectionViews& views, const std::vector<Pose>& poses,
                             const SelfCorrectionConfig& config);

// Whether the poses `after` make a blurrier map than `before`, beyond what beta can tell
// (SelfCorrectionConfig::blurrier_sd).
[[nodiscard]] bool blurs(const CorrectionViews& views, const std::vector<Pose>& before,
                         const std::vector<Pose>& after, const SelfCorrectionConfig& config);

// Pairs as the config asks for them, in its order; sets result.promising.
[[nodiscard]] std::vector<CorrectionPair> chosen_pairs(const CorrectionViews& views,
                                                       const SelfCorrectionConfig& config,
                                                       SelfCorrectionResult& result);

// What a match says, beside the poses that it began from.
[[nodiscard]] TriedCorrection tried_correction(const CorrectionPair& pair, const PairMatch& match,
                                               const std::vector<Pose>& poses);

// Each fills result.world_from_view, tried, promising, kept and stopped_because; the first poses
// are in result.world_from_view already.
void correct_by_powers(const CorrectionViews& views, const SelfCorrectionConfig& config,
                       SelfCorrectionResult& result);
void correct_by_lattice(const CorrectionViews& views, const SelfCorrectionConfig& config,
                        SelfCorrectionResult& result);
void correct_by_pose_graph(const CorrectionViews& views, const SelfCorrectionConfig& config,
                           SelfCorrectionResult& result);
void correct_by_gaussian_process(const CorrectionViews& views, const SelfCorrectionConfig& config,
                                 SelfCorrectionResult& result);
void correct_by_expected_gain(const CorrectionViews& views, const SelfCorrectionConfig& config,
                              SelfCorrectionResult& result);

}  // namespace understory
