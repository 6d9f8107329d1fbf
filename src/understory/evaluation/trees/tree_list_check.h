#pragma once

#include <string>
#include <vector>

#include "understory/evaluation/trees/tree_errors.h"
#include "understory/sensor/tree.h"

namespace understory {

// Why the diameters of a list cannot be in metres, in words for the user: no stand has such a
// median. Empty: nothing speaks against it, or too few diameters are known.
[[nodiscard]] std::string diameter_complaint(const std::vector<Tree>& trees);

// By what factor the diameters of B differ from those of A over pairs of one tree, in words for the
// user. Another unit or radii cause it. Empty: they agree, or too few pairs have both.
[[nodiscard]] std::string diameter_complaint(const std::vector<Tree>& a, const std::vector<Tree>& b,
                                             const std::vector<TreePair>& pairs);

// Rows that stand for a tree which an earlier row of the list holds already: no two stems stand
// within 5 cm. Positions in metres.
[[nodiscard]] std::size_t doubled_rows(const std::vector<Tree>& trees);
// Why a list counts trees twice, in words for the user. Empty: few of its rows do, as forks may.
[[nodiscard]] std::string doubles_complaint(const std::vector<Tree>& trees);

// Whether one list is a copy of the other, or of a part of it. Over half of the trees of the
// shorter one then stand in the longer one, in any order. They have the same place to the last
// digit and as many observations, and nearly all the same diameter and height where both know it.
// Trees of a permanent plot stay where they are, and are measured anew.
[[nodiscard]] bool are_copies(const std::vector<Tree>& a, const std::vector<Tree>& b);

}  // namespace understory
