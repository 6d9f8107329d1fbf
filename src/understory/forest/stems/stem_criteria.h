#pragma once

#include "understory/forest/stems/stem_detector.h"
#include "understory/forest/stems/stem_fit.h"

namespace understory {

// One way of cutting the points: thin slices for dense clouds, thick ones for what is left of
// sparse clouds.
struct SliceCut {
  double thickness_m = 0.25;
  int min_slices = 3;
  double reach_m = 0.0;     // between neighbours of one group of points
  double band_m = 0.0;      // on either side of a circle: points on it
  double blur_m = 0.0;      // of a blurred cloud: scatter that stems have; 0: no such cut
  bool only_clear = false;  // columns that stand clear or alone, and nothing else
};

// Degrees between the centre line and the vertical, 0 to 90.
[[nodiscard]] double lean_deg_of(const StemFit& stem);

// Is the first fit a stem, or a bush that a cone happens to fit? Ours: no paper names these tests.
[[nodiscard]] bool is_stem(const StemFitResult& fit, const SliceCut& cut,
                           const StemDetectorConfig& config);

// Is the first fit a column with hardly a point beside or inside it? Far stems are such columns.
// Their arc is often too flat for a first radius, which is too large then. The refined fit tells
// it.
[[nodiscard]] bool is_flat_column(const StemFitResult& fit, const SliceCut& cut,
                                  const StemDetectorConfig& config);

// Is it a stem after the refined fit, too? That may have found a much thinner one in the edge of
// the circle. What shows another side in each slice is a piece of a machine or a heap of branches.
[[nodiscard]] bool is_stem_still(const StemFitResult& fit, const SliceCut& cut,
                                 const StemDetectorConfig& config);

}  // namespace understory
