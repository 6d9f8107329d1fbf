#include "understory/registration/judged_match.h"

#include <algorithm>
#include <utility>

namespace understory {

std::string to_string(RegistrationStatus status) {
  switch (status) {
    case RegistrationStatus::kConverged:
      return "converged";
    case RegistrationStatus::kIterationLimit:
      return "iteration_limit";
    case RegistrationStatus::kDegenerate:
      return "degenerate";
    case RegistrationStatus::kTooFewPoints:
      return "too_few_points";
    case RegistrationStatus::kTooFewMatches:
      break;
  }
  return "too_few_matches";
}

namespace internal {
namespace {

// The Hessian promises what independent points with exactly modelled residuals would give; the
// residuals themselves tell by how much they are wider.
Matrix6d realistic_information(const MatchSums& at, double independent_share) {
  const double variance = at.weighted_rows > 0.0 ? at.weighted_residual / at.weighted_rows : 1.0;
  return independent_share / std::max(variance, 0.1) * at.hessian;
}

}  // namespace

RegistrationResult refused(RegistrationStatus status, std::string reason, const Pose& guess) {
  RegistrationResult result;
  result.status = status;
  result.reason = std::move(reason);
  result.target_from_source = guess;
  return result;
}

RegistrationResult judged_match(const Minimum& minimum, const MatchSums& at, const Points& source,
                                double range_m, const Pose& guess, const Judgement& judgement) {
  if (at.matched < static_cast<std::size_t>(judgement.min_matches)) {
    return refused(RegistrationStatus::kTooFewMatches,
                   "only " + std::to_string(at.matched) + " of " + std::to_string(source.size()) +
                       " points near the target",
                   guess);
  }
  if (!(at.hessian.trace() > 0.0)) {
    return refused(RegistrationStatus::kDegenerate, "nothing near constrains the pose", guess);
  }
  RegistrationResult result;
  result.target_from_source = minimum.pose;
  result.iterations = minimum.iterations;
  result.status =
      minimum.converged ? RegistrationStatus::kConverged : RegistrationStatus::kIterationLimit;
  if (!minimum.converged) {
    result.reason =
        "no small step within " + std::to_string(judgement.max_iterations) + " iterations";
  }
  const auto matched = static_cast<double>(at.matched);
  result.inlier_ratio = matched / static_cast<double>(source.size());
  result.fitness_m2 = at.matched > 0 ? at.nearest_squared / matched : 0.0;
  result.surface_residual_m2 = at.weight > 0.0 ? at.surface_squared / at.weight : 0.0;
  result.information = realistic_information(at, judgement.independent_share);
  result.degenerate_directions =
      degenerate_directions(result.information, range_m, judgement.degenerate_ratio);
  return result;
}

}  // namespace internal
}  // namespace understory
