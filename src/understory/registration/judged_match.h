#pragma once

#include <string>

#include "understory/registration/match_sums.h"
#include "understory/registration/solve.h"

namespace understory::internal {

// What the matchers' configurations have in common of how a match is judged.
struct Judgement {
  int min_matches = 0;
  int max_iterations = 0;
  double independent_share = 0.0;
  double degenerate_ratio = 0.0;

  template <typename Config>
  explicit Judgement(const Config& config)
      : min_matches(config.min_matches),
        max_iterations(config.max_iterations),
        independent_share(config.independent_share),
        degenerate_ratio(config.degenerate_ratio) {}
};

// A result without a match: the pose is the guess, the information 0.
[[nodiscard]] RegistrationResult refused(RegistrationStatus status, std::string reason,
                                         const Pose& guess);

// The result of a matcher that came to `minimum`, where `at` (with a positive Hessian) are its sums
// over `source`, whose mean range is `range_m`. Refused if hardly any point matched or nothing
// constrains the pose.
[[nodiscard]] RegistrationResult judged_match(const Minimum& minimum, const MatchSums& at,
                                              const Points& source, double range_m,
                                              const Pose& guess, const Judgement& judgement);

}  // namespace understory::internal
