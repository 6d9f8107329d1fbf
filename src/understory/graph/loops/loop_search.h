#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include "understory/graph/pose_graph.h"
#include "understory/util/time.h"

namespace understory {

// Which keyframes are asked whether their place is seen again.
struct LoopSearchConfig {
  // Paper: P4 (38) as it stands: the nearest keyframe but the recent ones, within a fixed gate.
  // Uncertainty: every place that could be seen again given the drift, best overlap first.
  enum class Method { kPaper, kUncertainty };
  Method method = Method::kUncertainty;
  int exclude_recent = 40;  // keyframes; theta_lc of (38)
  double gate_m = 5.0;      // paper: farther candidates are dropped
  double interval_s = 1.5;  // at most one evaluation in this time
  // Uncertainty: keyframes count as recent as long as the way since is shorter than this, whatever
  // their number.
  double exclude_path_m = 25.0;
  // Loops must also lie farther away than this share of the way since. A straight path sees its own
  // past for long, from behind, and learns nothing from it.
  double max_chord_ratio = 0.5;
  double view_radius_m = 20.0;  // how far scans overlap usefully
  double min_overlap = 0.5;     // expected share of common view, at the best the drift allows
  double sigmas = 2.5;          // how much of the drift's uncertainty the search covers
  double max_radius_m = 60.0;   // the end of it
  int max_candidates = 3;
  double spacing_m = 8.0;  // along the path between candidates of one search
};
void describe(ConfigTable& table, LoopSearchConfig& config);

// A keyframe whose place may be seen again.
struct LoopCandidate {
  int keyframe = 0;
  double distance_m = 0.0;
  double expected_overlap = 0.0;  // 0..1, of the two views at their estimated poses
  // Standard deviations of the relative pose between the candidate and the query.
  double sigma_translation_m = 0.0;
  double sigma_rotation_rad = 0.0;
};

// Candidates for the keyframe `query`, best first; possibly none. `problem` holds the keyframes,
// the odometry and the loops closed so far (which shorten the way over which drift has built up).
// `eligible`: which keyframes may be candidates; empty: all.
// Deterministic; thread-safe. Linear in the number of keyframes, with a logarithm for the way.
[[nodiscard]] std::vector<LoopCandidate> find_loop_candidates(
    const PoseGraphProblem& problem, std::size_t query, const LoopSearchConfig& config,
    const std::vector<char>& eligible = {});

// Whether a search is due at `now`, the last one having been at `last` (lowest value: none yet).
inline constexpr TimeNs kNoSearchYet = std::numeric_limits<TimeNs>::min();
[[nodiscard]] bool loop_search_due(TimeNs last, TimeNs now, const LoopSearchConfig& config);

}  // namespace understory
