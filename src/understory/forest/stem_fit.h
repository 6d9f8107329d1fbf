#pragma once

#include <Eigen/Core>
#include <vector>

#include "understory/forest/stem_detector.h"

namespace understory {

inline constexpr double kBreastHeight = 1.3;

// Figures of a fit that decide whether it is a stem.
struct StemEvidence {
  int on = 0;       // thinned points on the surface
  int returns = 0;  // returns of the cloud that they stand for
  int inside = 0;   // points well within the stem: of a real one there are none
  // Points per area just inside and just outside of the surface's band over those on it: a stem's
  // inside is empty, in foliage all three are alike.
  double inside_ratio = 0.0;
  double outside_ratio = 0.0;
  double even_arc_deg = 0.0;  // see ArcBins::even_deg
  int slices = 0;             // slices in which the surface shows
  double scatter_m = 0.0;
};

// Leaning, tapering cone through the points near `start`, by least squares with Tukey weights
// (perpendicular distances to the surface). The taper is held near -1 cm of radius per metre by a
// weak prior, the slope near the start's. Keeps the slices of `start`.
struct StemFitResult {
  bool converged = false;
  StemFit stem;
  StemEvidence evidence;
};
[[nodiscard]] StemFitResult fit_stem(const std::vector<SlicePoint>& points, const StemFit& start,
                                     const StemDetectorConfig& config);

// Distance of a point from the centre line, and its height along it over breast height.
struct AxisPlace {
  double distance_m = 0.0;
  double along_m = 0.0;
  Eigen::Vector3d outward = Eigen::Vector3d::Zero();  // unit, from the axis to the point
};
[[nodiscard]] AxisPlace place_on(const StemFit& stem, const SlicePoint& point);

}  // namespace understory
