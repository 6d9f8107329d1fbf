#pragma once

#include <vector>

#include "understory/forest/stems/stem_detector.h"

namespace understory {

// What speaks for a fitted section: points of the window about its surface.
struct SectionEvidence {
  int on = 0;
  int inside = 0;
  double arc_deg = 0.0;   // that holds points
  double seen_deg = 0.0;  // that was seen: all but the widest gap
};

// `fit`: the section; `scatter_m`: of its points about its surface. `points`: those of the window,
// with the middle of the section as breast height.
[[nodiscard]] SectionEvidence section_evidence(const std::vector<SlicePoint>& points,
                                               const StemFit& fit, double scatter_m);

}  // namespace understory
