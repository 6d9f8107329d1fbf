#pragma once

#include "understory/geometry/points.h"
#include "understory/graph/map_sharpness.h"

namespace understory {

// By how much the blur ratio beta, P0 (30), of a map differs from that of another, and how sure
// that is. One grid of cells tells changes of a hundredth as often wrong as right, since beta
// depends on where its corners lie. So cells are counted on several grids, and the noise of the
// difference is taken from how differently the parts of the map change.
struct BlurChange {
  double ratio = 1.0;  // of the fine cells after over those before, mean over the grids
  double deviations =
      0.0;  // of the change from none, in its own standard deviations; > 0: blurrier
};

// The same points in two maps, in the same order, in metres. Seen from above. An empty map does not
// change. Deterministic.
[[nodiscard]] BlurChange blur_change(const SparsePoints& before, const SparsePoints& after,
                                     const SharpnessConfig& config);

}  // namespace understory
