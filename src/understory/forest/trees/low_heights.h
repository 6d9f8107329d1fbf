#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "understory/forest/forest_constants.h"

namespace understory {

// How many points a cloud has in each decimetre above the ground, up to 5 m. They tell a stand of
// low trees, whose tops thin out, from a cloud that was cut off a little above breast height.
class LowHeights {
 public:
  void add(double height_m) {
    ++points_[height_m < kEnd ? static_cast<std::size_t>(10.0 * height_m) : kDecimetres];
  }
  void add(const LowHeights& other) {
    for (std::size_t d = 0; d < points_.size(); ++d)
      points_[d] += other.points_[d];
  }

  // Whether the points end as suddenly as those of a cut do. Nothing lies above 5 m then, and just
  // below the end they are as dense as farther down.
  [[nodiscard]] bool end_in_a_cut() const {
    using namespace forest_constants::low_heights;
    double all = 0.0;
    for (const std::uint64_t points : points_)
      all += static_cast<double>(points);
    if (at(kDecimetres) > kFewPoints * all) return false;
    std::size_t last = kDecimetres - 1;
    while (last > 0 && at(last) <= kFewPoints * all)
      --last;
    if (last < kBelow) return false;
    double below = 0.0;
    for (std::size_t d = last - kBelow; d < last - 1; ++d)
      below += at(d);
    return at(last - 1) >= kCutShare * below / static_cast<double>(kBelow - 1);
  }

 private:
  static constexpr std::size_t kDecimetres = 50;  // and one for all above
  static constexpr double kEnd = 5.0;
  static constexpr std::size_t kBelow = 10;
  [[nodiscard]] double at(std::size_t d) const { return static_cast<double>(points_[d]); }

  std::array<std::uint64_t, kDecimetres + 1> points_{};
};

}  // namespace understory
