#pragma once

#include <vector>

#include "understory/forest/dead_wood/dead_wood.h"

namespace understory {

// A lying stem in the frame of the search, metres, z up.
struct LogFit {
  Eigen::Vector3d from = Eigen::Vector3d::Zero();  // on the centre line
  Eigen::Vector3d to = Eigen::Vector3d::Zero();
  double diameter_m = 0.0;  // at `from`
  double diameter_to_m = 0.0;
  double diameter_sd_m = 0.0;
  int returns = 0;
  double quality = 0.0;  // of several fits to one log the highest counts
  [[nodiscard]] Eigen::Vector3d middle() const { return 0.5 * (from + to); }
};

// Lying stems. A line through points that stand out from the ground is the start of a cylinder.
// It grows along its axis as far as its surface shows. `points`: thinned, by height above
// `ground` (its raster relative to the same origin as they); they come back sorted by place.
// Points of `stems` are left out. Gives those with the middle in `area`, by x, then y of it.
// Deterministic for any number of threads.
[[nodiscard]] std::vector<LogFit> find_logs(std::vector<SlicePoint>& points, const Raster& ground,
                                            const std::vector<StemFit>& stems,
                                            const GroundArea& area, const ProgressSink& progress);
// m around the area: points so far away may matter.
[[nodiscard]] double log_search_reach();

}  // namespace understory
