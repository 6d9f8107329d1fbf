#pragma once

#include <Eigen/Core>
#include <vector>

#include "understory/forest/stems/stem_axis.h"
#include "understory/forest/stems/stem_detector.h"

namespace understory {

struct NoisyCylinder;

// Figures of a fit that decide whether it is a stem.
struct StemEvidence {
  int on = 0;       // thinned points on the surface
  int returns = 0;  // returns of the cloud that they stand for
  int inside = 0;   // points well within the stem: of a real one there are none
  // Points per area just inside and just outside of the surface's band, over those on it. A stem's
  // inside is empty; in foliage all three are alike.
  double inside_ratio = 0.0;
  double outside_ratio = 0.0;
  double even_arc_deg = 0.0;  // see ArcBins::even_deg
  int slices = 0;             // slices in which the surface shows
  int patches = 0;            // pieces of the surface, 30 degrees by one slice, that hold points
  // Pieces of 10 degrees that hold points over those that as many evenly laid ones would hit: small
  // where each slice shows another side.
  double fill = 0.0;
  double scatter_m = 0.0;
};

// Leaning, tapering cone through the points near `start`, by least squares with Tukey weights
// (perpendicular distances to the surface). The taper is held near -1 cm of radius per metre by a
// weak prior, the slope near the start's. Keeps the slices of `start`.
struct StemFitResult {
  bool converged = false;
  bool flat = false;  // the arc that was seen is too flat for a first radius
  StemFit stem;
  StemEvidence evidence;
};
// For a first decision: fast, but too thick where the points scatter much.
[[nodiscard]] StemFitResult fit_stem(const std::vector<SlicePoint>& points, const StemFit& start,
                                     const StemDetectorConfig& config);

// The same stem by fit_noisy_cylinder, from its fit and, where the points would also suit a thinner
// stem in the circle's edge, from that one. The likelier of both. `points` should hold all within
// 0.35 m of the surface. The figures are taken anew.
[[nodiscard]] StemFitResult refine_stem(const std::vector<SlicePoint>& points,
                                        const StemFitResult& fit, const StemDetectorConfig& config);

// The same for a thin stem within foliage, from a column that shows in it. Points of the foliage
// lie on all sides of it, and most of those near it may be theirs.
[[nodiscard]] StemFitResult fit_in_foliage(const std::vector<SlicePoint>& points,
                                           const StemFit& column, const StemDetectorConfig& config);

// Axis, radius, taper and scatter of a fit that converged, and how sure they are.
void take_cylinder(const NoisyCylinder& fit, StemFit& stem);

}  // namespace understory
