#include "understory/forest/stems/section_evidence.h"

#include <algorithm>
#include <cmath>

#include "understory/forest/stems/arc_bins.h"
#include "understory/forest/stems/stem_axis.h"
#include "understory/forest/stems/surface_band.h"

namespace understory {
namespace {

// All of the circumference but the widest gap between the directions (rad), in degrees. A scanner
// sees one side of a stem, and of n points over an arc the outermost leave 2 / (n + 1) of it out.
double seen_arc_deg(std::vector<double>& turns) {
  if (turns.size() < 2) return 0.0;
  std::sort(turns.begin(), turns.end());
  double gap = turns.front() + 2.0 * M_PI - turns.back();
  for (std::size_t i = 1; i < turns.size(); ++i)
    gap = std::max(gap, turns[i] - turns[i - 1]);
  const auto count = static_cast<double>(turns.size());
  const double seen = (2.0 * M_PI - gap) * (count + 1.0) / (count - 1.0);
  return std::min(360.0, seen * 180.0 / M_PI);
}

}  // namespace

SectionEvidence section_evidence(const std::vector<SlicePoint>& points, const StemFit& fit,
                                 double scatter_m) {
  const double band = surface_band_m(scatter_m);
  const double within = inside_from_m(band, fit.radius_m);
  SectionEvidence evidence;
  ArcBins arc;
  std::vector<double> turns;
  const StemAxis axis(fit);
  for (const SlicePoint& point : points) {
    const AxisPlace place = axis.place(point);
    const double e = axis.surface_error(place);
    if (e < within) ++evidence.inside;
    if (std::abs(e) > band) continue;
    ++evidence.on;
    arc.add(place.outward.x(), place.outward.y());
    turns.push_back(std::atan2(place.outward.y(), place.outward.x()));
  }
  evidence.seen_deg = seen_arc_deg(turns);
  evidence.arc_deg = arc.covered_deg();
  return evidence;
}

}  // namespace understory
