#pragma once

#include <optional>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/registration/global/search_cloud.h"
#include "understory/registration/registration.h"

namespace understory {

// A pose that the search came to, between the level frames of the clouds.
struct GlobalCandidate {
  Pose target_from_source;
  double score = 0.0;  // QuickFit both ways, added up: -2..2
  Pose by_uprights;    // where uprights alone put it
  int uprights = 0;    // how many did
};

// Poses anywhere and at any heading that may be right, the best first.
[[nodiscard]] std::vector<GlobalCandidate> search_poses(const SearchCloud& target,
                                                        const SearchCloud& source);

// The match of NDT with small cells from a pose near the right one.
[[nodiscard]] RegistrationResult refine_pose(const SearchCloud& target, const SearchCloud& source,
                                             const Pose& start, const PoseTerms& terms = {});
// What uprights tell of place and heading beside the match of points, and the level frames of tilt.
[[nodiscard]] PoseTerms upright_terms(const GlobalCandidate& candidate, double level_sd_rad);
// refine_pose of a candidate with what its uprights tell.
[[nodiscard]] RegistrationResult last_steps(const SearchCloud& target, const SearchCloud& source,
                                            const GlobalCandidate& candidate);
// The pose of a match without terms; nothing if it finds none.
[[nodiscard]] std::optional<Pose> refined_pose(const SearchCloud& target, const SearchCloud& source,
                                               const Pose& start);

// How well a pose fits, see GlobalCandidate::score.
[[nodiscard]] double pose_score(const SearchCloud& target, const SearchCloud& source,
                                const Pose& target_from_source);
// Whether two poses are one: within 1 m and 4 degrees.
[[nodiscard]] bool same_pose(const Pose& a, const Pose& b);

}  // namespace understory
