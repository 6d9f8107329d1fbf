#pragma once

#include <cstddef>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/registration/global/uprights.h"

namespace understory {

// A motion on which pairs of uprights agree: a turn about z and a shift, of levelled clouds.
struct UprightMatch {
  Pose target_from_source;
  int matched = 0;     // uprights of the source that have one of the target within reach, each once
  double score = 0.0;  // matched; those that do not rise with the others count less
};

// Motions that bring uprights onto uprights, anywhere and at any heading; the best first, `most` of
// them. Each two uprights of the source that are as far apart as two of the target vote for the
// motion between them. The fullest cells of votes are fitted by nearest uprights. Thread-safe,
// deterministic.
[[nodiscard]] std::vector<UprightMatch> match_uprights(const std::vector<Upright>& target,
                                                       const std::vector<Upright>& source,
                                                       std::size_t most);

}  // namespace understory
