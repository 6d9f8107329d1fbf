#pragma once

#include <optional>
#include <vector>

#include "understory/forest/form/stem_curve.h"
#include "understory/forest/stems/stem_detector.h"

namespace understory {

// The lowest fork of a stem. Several slices in a row show a section beside the stem, at least a
// third as thick and farther away upwards. Its line meets the stem below. A neighbour that leans
// stands apart at the ground; a branch is thinner or leans more.
// `points`: around the stem, by height above the ground at the stem. `curve`: of the stem, same
// frame. Deterministic.
[[nodiscard]] std::optional<StemFork> find_fork(const std::vector<SlicePoint>& points,
                                                const StemCurve& curve);

}  // namespace understory
