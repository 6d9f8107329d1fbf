#include "understory/registration/global/global_match.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <utility>

#include "understory/registration/global/feature_search.h"
#include "understory/registration/global/global_constants.h"
#include "understory/registration/global/pose_evidence.h"
#include "understory/registration/global/upright_search.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace registration_constants::global_match;

void sort_by_score(std::vector<GlobalCandidate>& candidates) {
  sort_stably(candidates,
              [](const GlobalCandidate& a, const GlobalCandidate& b) { return a.score > b.score; });
}

// Of poses that are the same the first stays.
void drop_doubles(std::vector<GlobalCandidate>& candidates) {
  std::vector<GlobalCandidate> kept;
  for (const GlobalCandidate& candidate : candidates) {
    const bool known = std::any_of(kept.begin(), kept.end(), [&](const GlobalCandidate& other) {
      return same_pose(other.target_from_source, candidate.target_from_source);
    });
    if (!known) kept.push_back(candidate);
  }
  candidates = std::move(kept);
}

// Matches a few points of the source from where uprights put it, raised by so much.
void refine_coarsely(const SearchCloud& target, const SearchCloud& source, const Points& few,
                     double raised_m, GlobalCandidate& candidate) {
  const Pose up(Eigen::Quaterniond::Identity(), {0.0, 0.0, raised_m});
  const RegistrationResult result = target.target->match(
      few, up * candidate.by_uprights, upright_terms(candidate, kLevelSd), MatchStart::kFar);
  if (!result.usable()) return;
  candidate.target_from_source = result.target_from_source;
  candidate.score = pose_score(target, source, candidate.target_from_source);
}

// Uprights tell no height, and where the ground is hidden the height is off by a metre. A match
// that begins there tilts the source until some ground meets. Of several heights the one whose
// match has the most voxels in common is taken.
void try_heights(const SearchCloud& target, const SearchCloud& source, const Points& few,
                 GlobalCandidate& best) {
  double most = common_voxels(target, source, best.target_from_source);
  const GlobalCandidate start = best;
  for (const double raised_m : kHeights) {
    GlobalCandidate candidate = start;
    refine_coarsely(target, source, few, raised_m, candidate);
    const double common = common_voxels(target, source, candidate.target_from_source);
    if (common <= most) continue;
    most = common;
    best = candidate;
  }
}

// Refines the best few of the candidates, and leaves those alone.
void refine_best(const SearchCloud& target, const SearchCloud& source, const Points& few,
                 std::vector<GlobalCandidate>& candidates) {
  sort_by_score(candidates);
  drop_doubles(candidates);
  candidates.resize(std::min(candidates.size(), kRefined));
  for (GlobalCandidate& candidate : candidates)
    refine_coarsely(target, source, few, 0.0, candidate);
  sort_by_score(candidates);
  drop_doubles(candidates);
}

// Poses by what looks alike, where uprights tell none that fits. The features are worked out here,
// because few clouds need them.
std::vector<GlobalCandidate> by_features(const SearchCloud& target, const SearchCloud& source) {
  const auto found = match_local_features(
      find_local_features(target.points, target.above_m, kFeatures),
      find_local_features(source.points, source.above_m, kFeatures), kCandidates);
  std::vector<GlobalCandidate> candidates;
  for (const FeatureMatch& match : found) {
    candidates.push_back({match.target_from_source,
                          pose_score(target, source, match.target_from_source),
                          match.target_from_source, 0});
  }
  return candidates;
}

}  // namespace

std::vector<GlobalCandidate> search_poses(const SearchCloud& target, const SearchCloud& source) {
  std::vector<GlobalCandidate> candidates;
  for (const UprightMatch& match : match_uprights(target.uprights, source.uprights, kCandidates)) {
    candidates.push_back({match.target_from_source,
                          pose_score(target, source, match.target_from_source),
                          match.target_from_source, match.matched});
  }
  Points few = thin_evenly(source.plants, kFewPlants, source.plants.size() + 1);
  few.insert(few.end(), source.ground.begin(), source.ground.end());
  refine_best(target, source, few, candidates);
  if (candidates.empty() || candidates.front().score < kPoorScore) {
    std::vector<GlobalCandidate> others = by_features(target, source);
    refine_best(target, source, few, others);
    candidates.insert(candidates.end(), others.begin(), others.end());
    sort_by_score(candidates);
    drop_doubles(candidates);
  }
  if (!candidates.empty() && candidates.front().score < kSureScore)
    try_heights(target, source, few, candidates.front());
  return candidates;
}

PoseTerms upright_terms(const GlobalCandidate& candidate, double level_sd_rad) {
  if (candidate.uprights < kFewestUprights) return {};
  const double place = candidate.uprights / (kUprightSd * kUprightSd);
  const double tilt = 1.0 / (level_sd_rad * level_sd_rad);
  PosePrior prior{candidate.by_uprights, Matrix6d::Zero()};
  prior.information.diagonal() << tilt, tilt, place * kSpread * kSpread, place, place, 0.0;
  return {prior};
}

RegistrationResult last_steps(const SearchCloud& target, const SearchCloud& source,
                              const GlobalCandidate& candidate) {
  SparseBelief belief = belief_of_sparse(target, source, candidate.target_from_source);
  if (belief.terms.empty()) {
    return refine_pose(target, source, candidate.target_from_source,
                       upright_terms(candidate, kLastLevelSd));
  }
  // The fit knows the tilt; uprights add place and heading.
  const PoseTerms flat = upright_terms(candidate, kNoLevelSd);
  belief.terms.insert(belief.terms.end(), flat.begin(), flat.end());
  RegistrationResult result = refine_pose(target, source, belief.start, belief.terms);
  count_terms(belief.terms, source.range_m, result);
  return result;
}

RegistrationResult refine_pose(const SearchCloud& target, const SearchCloud& source,
                               const Pose& start, const PoseTerms& terms) {
  const Points some = thin_evenly(source.points, kLastPoints, source.points.size() + 1);
  return target.fine_target->match(some, start, terms, MatchStart::kFar);
}

std::optional<Pose> refined_pose(const SearchCloud& target, const SearchCloud& source,
                                 const Pose& start) {
  const SparseBelief belief = belief_of_sparse(target, source, start);
  const RegistrationResult result = refine_pose(target, source, belief.start, belief.terms);
  if (!result.usable()) return std::nullopt;
  return result.target_from_source;
}

double pose_score(const SearchCloud& target, const SearchCloud& source,
                  const Pose& target_from_source) {
  return quick_fit(target, source, target_from_source).score() +
         quick_fit(source, target, target_from_source.inverse()).score();
}

bool same_pose(const Pose& a, const Pose& b) {
  const Pose step = a.inverse() * b;
  return step.translation().norm() < kSamePose && step.angle() < kSameHeading;
}

}  // namespace understory
