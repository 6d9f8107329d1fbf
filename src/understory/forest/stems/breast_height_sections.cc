#include "understory/forest/stems/breast_height_sections.h"

#include <cmath>
#include <cstddef>

#include "understory/forest/stem_curve_constants.h"
#include "understory/forest/stems/noisy_cylinder.h"
#include "understory/forest/stems/range_noise.h"
#include "understory/forest/stems/section_evidence.h"
#include "understory/forest/stems/stem_axis.h"

namespace understory {
namespace {

using namespace stem_constants::breast_height_sections;

// The points of a section, with its height as breast height.
std::vector<SlicePoint> points_of(const std::vector<SlicePoint>& points, const StemFit& stem,
                                  double rise_m) {
  const double reach = fit_reach_m(stem.range_noise_m);
  std::vector<SlicePoint> section;
  const StemAxis axis(stem);
  for (const SlicePoint& point : points) {
    const double height = static_cast<double>(point.height_m) - rise_m;
    if (std::abs(height - kBreastHeight) > kHalfWindow) continue;
    if (std::abs(axis.surface_error(point)) > reach) continue;
    SlicePoint moved = point;
    moved.height_m = static_cast<float>(height);
    section.push_back(moved);
  }
  return section;
}

StemFit fit_of(const NoisyCylinder& section) {
  StemFit fit;
  fit.centre = section.centre;
  fit.slope = section.slope;
  fit.radius_m = section.radius_m;
  fit.taper = section.taper;
  return fit;
}

}  // namespace

double radius_with_sections(const std::vector<SlicePoint>& points, const StemFit& stem) {
  double weights = 0.0;
  double sum = 0.0;
  int sections = 0;
  NoisyCylinderConfig config;
  config.range_noise_m = stem.range_noise_m;
  config.stray_reach_m = fit_reach_m(stem.range_noise_m);
  for (int k = -kSectionsBeside; k <= kSectionsBeside; ++k) {
    const double rise = k * kStep;
    const std::vector<SlicePoint> near = points_of(points, stem, rise);
    if (near.size() < static_cast<std::size_t>(kFewestPoints)) continue;
    StemFit start = stem;
    start.centre += rise * stem.slope;
    start.radius_m += rise * stem.taper;
    start.taper = kUsualTaper;
    const NoisyCylinder found = fit_noisy_cylinder(near, start, config);
    if (!found.converged || found.strays > kMostStrays) continue;
    const double shift = (found.centre - start.centre).norm();
    const double change = std::abs(found.radius_m - start.radius_m);
    if (shift > kMostShift + kMostShiftShare * stem.radius_m ||
        change > kMostChange + kMostChangeShare * stem.radius_m ||
        section_evidence(near, fit_of(found), found.scatter_m).arc_deg <
            kLeastArcShare * stem.arc_deg)
      continue;
    const double variance = found.covariance(4, 4) + kOwnSd * kOwnSd;
    weights += 1.0 / variance;
    sum += (found.radius_m - kUsualTaper * rise) / variance;
    ++sections;
  }
  if (sections < kFewestSections) return stem.radius_m;
  const double whole = kConeSd * kConeSd + kLinear * kLinear * stem.spread_m * stem.spread_m;
  const double share = whole / (whole + kShared / weights);
  return stem.radius_m + share * (sum / weights - stem.radius_m);
}

}  // namespace understory
