#pragma once

#include <vector>

#include "understory/registration/stems/sparse_icp.h"
#include "understory/util/config/config.h"

namespace understory {

// Coarse search over yaw and horizontal translation for levelled sparse clouds. For every yaw each
// pair of points votes for the shift that would bring it together. The fullest cells are first
// guesses for ICP. Step and cell come from L0, so nothing is tuned to the density of a stand.
struct YawVoteConfig {
  double yaw_range_deg = 180.0;     // around the guess
  double shift_range_m = 6.0;       // around the guess, per axis
  double cell_ratio = 0.12;         // side of a cell of shifts, in L0
  int candidates = 4;               // guesses handed on
  double height_range_ratio = 0.5;  // pairs whose heights differ more do not vote, in L0
};
void describe(ConfigTable& table, YawVoteConfig& config);

// A motion in the plane that many pairs of stems agree on.
struct YawVoteCandidate {
  Pose target_from_source;
  double votes = 0.0;  // about the number of pairs that agree
};

// Best first; `guess` is level (yaw and translation); heights are those of the guess, moved by the
// median of the pairs that agree. Deterministic; thread-safe.
[[nodiscard]] std::vector<YawVoteCandidate> vote_yaw(const SparseTarget& target,
                                                     const SparsePoints& source, const Pose& guess,
                                                     const YawVoteConfig& config);

}  // namespace understory
