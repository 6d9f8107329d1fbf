#pragma once

#include <vector>

#include "understory/geometry/raster.h"

namespace understory {

// How far off a terrain model may be where no ground was seen. What fills a gap knows neither the
// hollow nor the rise in it. So the error grows with the distance from the ground that was seen,
// and with how rough that ground is.
class UnseenGround {
 public:
  UnseenGround() = default;  // all was seen
  // `seen`: the ground that was seen, metres; NaN elsewhere.
  explicit UnseenGround(const Raster& seen);

  // Standard deviation of the terrain's height at a place of the frame of `seen`, metres. 0 where
  // the ground was seen. As at the nearest cell outside of the raster.
  [[nodiscard]] double sd_m(double x, double y) const;
  // Standard deviation of the seen ground from the middle of what lies 2 m to both sides, metres; 0
  // where too little was seen to tell.
  [[nodiscard]] double roughness_m() const { return roughness_m_; }

 private:
  Raster grid_;  // without values
  std::vector<char> seen_;
  double roughness_m_ = 0.0;
};

}  // namespace understory
