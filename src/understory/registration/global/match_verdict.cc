#include "understory/registration/global/match_verdict.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <optional>
#include <utility>
#include <variant>
#include <vector>

#include "understory/registration/global/global_constants.h"
#include "understory/registration/global/tilt_and_height.h"

namespace understory {
namespace {

using namespace registration_constants::match_verdict;

double degrees(double radians) {
  return radians * 180.0 / std::numbers::pi;
}

std::string share_of(double share) {
  return fmt::format("{:.0f} %", 100.0 * share);
}

// What speaks most against a pose that is not to be believed.
std::string reason_of(const MatchVerdict& verdict, const Pose& pose) {
  const PoseEvidence& e = verdict.evidence;
  if (verdict.rival && verdict.rival->score > verdict.score - kRivalGap) {
    const Pose away = pose.inverse() * verdict.rival->target_from_source;
    return fmt::format("another pose, {:.1f} m and {:.0f} degrees away, fits {}",
                       away.translation().norm(), degrees(away.angle()),
                       verdict.rival->score > verdict.score ? "better" : "nearly as well");
  }
  if (e.seen_through > kMuchThrough * e.near) {
    return share_of(e.seen_through) +
           " of the points above the ground lie where the other scan saw farther";
  }
  if (e.near < kLittleNear)
    return "only " + share_of(e.near) + " of the points above the ground lie near the other cloud";
  if (e.fine < kLittleSharper * e.fine_aside)
    return "the clouds fit hardly better there than half a metre beside it";
  return "the chance that the pose is right is only " + share_of(verdict.chance);
}

// Why no pose between these clouds can be judged; empty: it can.
std::string refusal_of(const SearchCloud& target, const SearchCloud& source) {
  if (!target.trouble.empty()) return "the target cannot be judged: " + target.trouble;
  if (!source.trouble.empty()) return "the source cannot be judged: " + source.trouble;
  for (const SearchCloud* cloud : {&target, &source}) {
    if (cloud->plants.size() < kFewestPlants)
      return "too little stands above the ground to tell whether a match is right";
  }
  return "";
}

MatchVerdict refused_verdict(std::string reason) {
  MatchVerdict verdict;
  verdict.reason = std::move(reason);
  return verdict;
}

// A match, and of sparse clouds a second one with the tilt and the height that stems and ground
// tell where the first came to.
RegistrationResult match_twice(const SearchCloud& a, const SearchCloud& b, const Pose& guess,
                               const MatchFrom& match) {
  RegistrationResult first = match(guess, {});
  if (!refusal_of(a, b).empty()) return first;
  const Pose& came_to = first.usable() ? first.target_from_source : guess;
  const SparseBelief belief =
      belief_of_sparse(a, b, a.level_from_cloud * came_to * b.level_from_cloud.inverse());
  if (belief.terms.empty()) return first;
  PosePrior prior = std::get<PosePrior>(belief.terms.front());
  prior.target_from_source =
      a.level_from_cloud.inverse() * prior.target_from_source * b.level_from_cloud;
  const Matrix6d to_level = b.level_from_cloud.adjoint();
  prior.information = to_level.transpose() * prior.information * to_level;
  const PoseTerms terms = {prior};
  RegistrationResult second = match(prior.target_from_source, terms);
  if (!second.usable()) return first;
  count_terms(terms, b.range_m, second);
  second.iterations += first.iterations;
  return second;
}

std::string trouble_of(const RegistrationResult& result) {
  if (result.status != RegistrationStatus::kConverged)
    return result.reason.empty() ? to_string(result.status) : result.reason;
  return result.degenerate_directions.cols() > 0 ? "some directions are undetermined" : "";
}

// Refuses a match of sparse scans that tells the place too loosely. A result without information
// tells nothing of it.
void refuse_if_loose(const SearchCloud& target, const SearchCloud& source,
                     const RegistrationResult& result, MatchVerdict& verdict) {
  if (!verdict.trusted || !sparse_views(target, source) || !(result.information.trace() > 0.0))
    return;
  const Matrix6d covariance = result.information.inverse();
  const double sd_m = std::sqrt(covariance.bottomRightCorner<3, 3>().trace());
  if (sd_m < kMostSparseSd) return;
  verdict.trusted = false;
  verdict.reason =
      fmt::format("the scans share too little to tell the place better than {:.2f} m", sd_m);
}

}  // namespace

double chance_of_right(const PoseEvidence& evidence, double score,
                       std::optional<double> rival_score, bool sparse) {
  const double gap = rival_score ? std::clamp(score - *rival_score, kLeastGap, kMostGap) : kNoRival;
  const bool looked = evidence.looked_at > 0.0;
  const std::array<double, 6> traits = {
      1.0,
      evidence.near,
      looked ? std::log((evidence.seen_through + kThroughFloor) / (evidence.near + kNearFloor))
             : kUsualThrough,
      std::log((evidence.fine + kFineFloor) / (evidence.fine_aside + kFineFloor)),
      std::log((evidence.matched + 1.0) / (evidence.by_chance + 1.0)),
      gap};
  const std::array<double, 6>& weights = sparse ? kSparseWeights : kWeights;
  double sum = 0.0;
  for (std::size_t i = 0; i < traits.size(); ++i)
    sum += weights[i] * traits[i];
  return 1.0 / (1.0 + std::exp(-sum));
}

bool sparse_views(const SearchCloud& target, const SearchCloud& source) {
  return target.view && source.view && (target.few_rings || source.few_rings);
}

MatchVerdict judge_pose(const SearchCloud& target, const SearchCloud& source,
                        const Pose& target_from_source, const std::vector<GlobalCandidate>& found) {
  if (std::string refusal = refusal_of(target, source); !refusal.empty())
    return refused_verdict(std::move(refusal));
  MatchVerdict verdict;
  verdict.evidence = weigh_pose(target, source, target_from_source);
  verdict.score = pose_score(target, source, target_from_source);
  for (const GlobalCandidate& candidate : found) {
    if (same_pose(candidate.target_from_source, target_from_source)) continue;
    verdict.rival = RivalPose{candidate.target_from_source, candidate.score};
    break;
  }
  verdict.chance =
      chance_of_right(verdict.evidence, verdict.score,
                      verdict.rival ? std::optional(verdict.rival->score) : std::nullopt,
                      sparse_views(target, source));
  if (const std::optional<Pose> refined = refined_pose(target, source, target_from_source)) {
    const Pose on = target_from_source.inverse() * *refined;
    verdict.moved_m = on.translation().norm();
    verdict.moved_deg = degrees(on.angle());
  }
  verdict.trusted = verdict.chance >= kTrusted;
  if (!verdict.trusted) {
    verdict.reason = reason_of(verdict, target_from_source);
  } else if (verdict.moved_m > kMostMoved || verdict.moved_deg > kMostTurned) {
    verdict.trusted = false;
    verdict.reason = fmt::format(
        "matching with small cells moves the pose on by {:.2f} m and "
        "{:.1f} degrees",
        verdict.moved_m, verdict.moved_deg);
  }
  return verdict;
}

MatchVerdict judge_match(const SearchCloud& a, const SearchCloud& b,
                         const RegistrationResult& result,
                         const std::vector<GlobalCandidate>& found) {
  if (std::string trouble = trouble_of(result); !trouble.empty())
    return refused_verdict(std::move(trouble));
  if (std::string refusal = refusal_of(a, b); !refusal.empty())
    return refused_verdict(std::move(refusal));
  const Pose pose = a.level_from_cloud * result.target_from_source * b.level_from_cloud.inverse();
  MatchVerdict verdict = judge_pose(a, b, pose, found);
  refuse_if_loose(a, b, result, verdict);
  return verdict;
}

GlobalRegistration match_and_judge(const SearchCloud& a, const SearchCloud& b, const Pose& guess,
                                   const MatchFrom& match,
                                   const std::vector<GlobalCandidate>& found) {
  GlobalRegistration done;
  done.result = match_twice(a, b, guess, match);
  done.verdict = judge_match(a, b, done.result, found);
  if (done.verdict.trusted || found.empty()) return done;
  GlobalRegistration again;
  again.result = match_twice(
      a, b, a.level_from_cloud.inverse() * found.front().target_from_source * b.level_from_cloud,
      match);
  again.verdict = judge_match(a, b, again.result, found);
  if (!again.verdict.trusted) return done;
  again.result.iterations += done.result.iterations;
  return again;
}

GlobalRegistration match_and_judge(const Points& target, const Points& source, const Pose& guess,
                                   const MatchFrom& match) {
  const SearchCloud a = prepare_search(target);
  const SearchCloud b = prepare_search(source);
  std::vector<GlobalCandidate> found;
  if (refusal_of(a, b).empty()) found = search_poses(a, b);
  return match_and_judge(a, b, guess, match, found);
}

GlobalRegistration register_globally(const Points& target, const Points& source) {
  return register_globally(prepare_search(target), prepare_search(source));
}

GlobalRegistration register_globally(const SearchCloud& a, const SearchCloud& b) {
  GlobalRegistration done;
  done.result.status = RegistrationStatus::kTooFewPoints;
  done.result.reason = refusal_of(a, b);
  done.verdict.reason = done.result.reason;
  if (!done.result.reason.empty()) return done;
  const std::vector<GlobalCandidate> found = search_poses(a, b);
  if (found.empty()) {
    done.result.status = RegistrationStatus::kTooFewMatches;
    done.result.reason = "nothing was found that stands alike in both clouds";
    done.verdict.reason = done.result.reason;
    return done;
  }
  done.result = last_steps(a, b, found.front());
  done.verdict = judge_pose(a, b, done.result.target_from_source, found);
  refuse_if_loose(a, b, done.result, done.verdict);
  if (const std::string trouble = trouble_of(done.result); !trouble.empty()) {
    done.verdict.trusted = false;
    done.verdict.reason = trouble;
  }
  done.result.target_from_source =
      a.level_from_cloud.inverse() * done.result.target_from_source * b.level_from_cloud;
  return done;
}

}  // namespace understory
