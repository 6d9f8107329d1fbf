#pragma once

#include <vector>

#include "understory/forest/stems/stem_detector.h"
#include "understory/util/progress.h"

namespace understory {

// A stem in a thin horizontal cut.
struct SliceStem {
  StemFit stem;  // upright; `centre` and `radius_m` are those of the cut
  // Metres between two rings of the same stem, where its points lie on two: scans that do not lie
  // on each other. 0: one ring.
  double rings_apart_m = 0.0;
};

// Stems among the points of one thin cut. Their heights are not looked at, and are set to breast
// height. A stem is a circle with an empty inside. One cut cannot tell a stem from a round bush, so
// less is tested than in `detect_stems`. The diameter is that of a noisy cylinder (see
// noisy_cylinder.h). Deterministic for any number of threads; sorted by x, then y. Polls
// `progress`.
[[nodiscard]] std::vector<SliceStem> measure_slice(std::vector<SlicePoint>& points,
                                                   const StemDetectorConfig& config,
                                                   const ProgressSink& progress = {});

}  // namespace understory
