#pragma once

#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "understory/geometry/points.h"
#include "understory/geometry/pose.h"
#include "understory/registration/global/global_match.h"
#include "understory/registration/global/pose_evidence.h"
#include "understory/registration/global/search_cloud.h"
#include "understory/registration/registration.h"

namespace understory {

// The best of the poses that the search found and that are not the one judged.
struct RivalPose {
  Pose target_from_source;  // level frames
  double score = 0.0;       // as GlobalCandidate::score
};

// Whether a pose may be believed, and why not.
struct MatchVerdict {
  bool trusted = false;
  double chance = 0.0;  // that the pose is right, within 0.5 m and 2 degrees: 0..1
  std::string reason;   // in plain words; empty if trusted
  PoseEvidence evidence;
  double score = 0.0;  // of the pose, as GlobalCandidate::score
  std::optional<RivalPose> rival;
  // How far NDT with small cells moves the pose on. NaN where sparse clouds have too little for it,
  // and then it says nothing against the pose.
  double moved_m = std::numeric_limits<double>::quiet_NaN();
  double moved_deg = std::numeric_limits<double>::quiet_NaN();
};

// The chance that a pose is right, by logistic regression on simulated and real pairs
// (benchmarks/registration/fit_verdict.py). `rival_score`: of the best other pose, if there is one.
// `sparse`: see sparse_views.
[[nodiscard]] double chance_of_right(const PoseEvidence& evidence, double score,
                                     std::optional<double> rival_score, bool sparse = false);

// Whether both clouds are single scans and one of them has few rings.
[[nodiscard]] bool sparse_views(const SearchCloud& target, const SearchCloud& source);

// Judges a pose between the level frames of two clouds. `found`: what search_poses gave for them.
// Thread-safe, deterministic.
[[nodiscard]] MatchVerdict judge_pose(const SearchCloud& target, const SearchCloud& source,
                                      const Pose& target_from_source,
                                      const std::vector<GlobalCandidate>& found);

// The same for the outcome of any method, between the frames of the points (metres, z about up). A
// match that did not converge, or that leaves directions open, is never trusted. Nor is one of
// sparse scans whose information leaves the place open by more than 0.15 m (standard deviation).
[[nodiscard]] MatchVerdict judge_match(const SearchCloud& target, const SearchCloud& source,
                                       const RegistrationResult& result,
                                       const std::vector<GlobalCandidate>& found);

// A match without a guess, and what is to be thought of it.
struct GlobalRegistration {
  RegistrationResult result;  // of NDT at the end; kTooFewMatches where no pose was found
  MatchVerdict verdict;
};

// What a method makes of a guess and of terms beside the points; poses between the frames of the
// points.
using MatchFrom = std::function<RegistrationResult(const Pose& guess, const PoseTerms& terms)>;

// The match that a method makes from a guess, with its verdict. Where that is not trusted, the
// method begins again at the best pose of a search without a guess. That answer is taken if it is
// trusted. Sparse clouds are matched twice: the second time with the tilt and the height that stems
// and ground tell at the first pose (belief_of_sparse). The frames are those of the points;
// `found`: what search_poses gave for the clouds.
[[nodiscard]] GlobalRegistration match_and_judge(const SearchCloud& target,
                                                 const SearchCloud& source, const Pose& guess,
                                                 const MatchFrom& match,
                                                 const std::vector<GlobalCandidate>& found);
// The same for clouds that are not ready.
[[nodiscard]] GlobalRegistration match_and_judge(const Points& target, const Points& source,
                                                 const Pose& guess, const MatchFrom& match);

// Finds the pose of the source on the target anywhere and at any heading. Both clouds: metres, z
// within 40 degrees of up, each in its own frame. Thread-safe; same bits for any number of threads.
[[nodiscard]] GlobalRegistration register_globally(const Points& target, const Points& source);
// The same for clouds that are ready, between the frames of their points.
[[nodiscard]] GlobalRegistration register_globally(const SearchCloud& target,
                                                   const SearchCloud& source);

}  // namespace understory
