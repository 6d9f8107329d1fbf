#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "understory/forest/stems/point_index.h"
#include "understory/forest/stems/stem_detector.h"

namespace understory {

// Noise of the ranges lies along the beams. A fit that takes it for scatter to all sides finds
// stems too thin: it removes from their width what is not there. The stems of a cloud together tell
// that noise, and are measured with it.

// The points around the stems of a cloud or of a part of it.
class StemPoints {
 public:
  // Sorts the points by place. Both outlive this.
  StemPoints(std::vector<SlicePoint>& points, const std::vector<StemFit>& stems)
      : index_(points), points_(points), stems_(stems) {}
  // Those within 0.35 m of the surface of one of the stems, without those that lie on or in
  // another one.
  [[nodiscard]] std::vector<SlicePoint> around(const StemFit& stem) const;

 private:
  PointIndex index_;
  const std::vector<SlicePoint>& points_;
  const std::vector<StemFit>& stems_;
};

// Whether stems of this kind tell the noise: seen in many returns, and thick.
[[nodiscard]] bool tells_range_noise(const StemFit& stem);

// The best of the stems that tell it, by their returns: places in the list. They are enough.
[[nodiscard]] std::vector<std::size_t> stems_for_range_noise(const std::vector<StemFit>& stems);

// A stem fitted with scatter to all sides alone, and with most of it along the beams. Path errors
// scatter to all sides, and ranges along the beams.
struct RangeNoiseFits {
  double noise_m = 0.0;      // along the beams, in the plane; of the second fit
  double likelier_by = 0.0;  // the second one: mean logarithm of the likelihood over the returns
};
// Nothing where one of the fits fails. `points`: around the stem.
[[nodiscard]] std::optional<RangeNoiseFits> fit_range_noise(const std::vector<SlicePoint>& points,
                                                            const StemFit& stem);

// Standard deviation of the points along the beams of a cloud, metres. Some of its stems decide
// together whether there is one: a stem that was seen from all sides tells little. The noise is the
// median of theirs. 0 of fewer than three stems, or below 3 mm.
[[nodiscard]] double range_noise_of(const std::vector<RangeNoiseFits>& stems);

// m around the surface of a stem: points that its fits take. `range_noise_m`: as of range_noise_of.
[[nodiscard]] double fit_reach_m(double range_noise_m);

// Measures a stem that was found once more, as it is at breast height. With noise its axis, taper
// and radius are fitted again (fit_noisy_cylinder). In any case `section_radius_m` is set, see
// radius_with_sections. `points`: around it.
void measure_at_breast_height(const std::vector<SlicePoint>& points, double range_noise_m,
                              StemFit& stem);

}  // namespace understory
