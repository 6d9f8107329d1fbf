#pragma once

#include <cstdint>

#include "understory/simulation/site.h"
#include "understory/simulation/stand/stand.h"

namespace understory {

// What of a stem is not round: an oval and lobed section that turns slowly with height, swellings
// at branches, and bark. It depends on the place on the bark alone and has the mean zero around and
// along the stem. So the mean diameter (girth / pi) is the tree's. A value type; calls are
// thread-safe.
class StemSurface {
 public:
  StemSurface() = default;  // round and smooth
  StemSurface(const StandConfig& config, const GrownTree& tree, std::uint64_t seed);

  // Metres by which the bark lies outside of the round stem, at a height above the foot. (x, y) is
  // the side: a vector of length 1 in the world's plane.
  [[nodiscard]] float offset(float x, float y, float height_m) const;

  // Share of the radius by which the section is lobed `order` (2, 3 or 4) times around at a height.
  [[nodiscard]] float lobe(int order, float height_m) const;

  [[nodiscard]] bool round() const { return round_; }

 private:
  // A wave around the stem: cosine and sine shares of the radius at the foot, and what is added
  // up to the top.
  struct Wave {
    float cosine = 0.0F;
    float sine = 0.0F;
    float more_cosine = 0.0F;
    float more_sine = 0.0F;
  };
  [[nodiscard]] float bark(float x, float y, float height_m) const;

  bool round_ = true;
  Wave waves_[3];  // of second, third and fourth order
  float radius_m_ = 0.1F;
  float height_m_ = 1.0F;
  float crown_base_m_ = 1.0F;
  float whorl_m_ = 0.4F;
  float swelling_m_ = 0.0F;
  float relief_low_m_ = 0.0F;  // standard deviation at the foot
  float relief_high_m_ = 0.0F;
  std::int32_t plates_ = 1;  // around the stem
  std::uint32_t key_ = 0;
};

}  // namespace understory
