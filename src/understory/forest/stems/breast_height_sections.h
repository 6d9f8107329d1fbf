#pragma once

#include <vector>

#include "understory/forest/stems/stem_detector.h"

namespace understory {

// The radius of a stem at breast height, metres. It is a mean of the radius of the whole stem and
// those of short sections around breast height, weighted by their variances. The fit of the whole
// stem takes it for a cone. A stem that bows, sways or swells towards its roots is none. `stem`:
// that fit, before beams are compensated. `points`: around it, height above the ground, in any
// order. The noise along the beams is that of `stem`. Where fewer than three sections are seen, it
// is the radius of `stem`.
[[nodiscard]] double radius_with_sections(const std::vector<SlicePoint>& points,
                                          const StemFit& stem);

}  // namespace understory
