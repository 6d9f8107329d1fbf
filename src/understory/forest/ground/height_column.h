#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

namespace understory {

// How many points stand over a place, by metres above the ground. Ghosts of other pulses may fill
// the sky, far fewer than the points of a crown, and thinner with height. A top is where the points
// suddenly become few.
struct HeightColumn {
  static constexpr int kMetres = 64;  // the last one: and above
  std::array<std::uint32_t, kMetres> points{};

  [[nodiscard]] static std::size_t metre_of(double height_m) {  // >= 0
    return static_cast<std::size_t>(std::min(height_m, kMetres - 1.0));
  }
  // End of what hangs together from metre `first` on: a gap of `largest_gap` metres follows that
  // hold less than a hundredth of the fullest one.
  [[nodiscard]] int connected_end(int first, int largest_gap) const;
  // The metre of the top among [first, end), end > first.
  [[nodiscard]] int top(int first, int end) const;

 private:
  [[nodiscard]] int clearest_drop(int first, int end) const;
  [[nodiscard]] int thin_tip(int top) const;
  [[nodiscard]] double at(int metre) const {
    return static_cast<double>(points[static_cast<std::size_t>(metre)]);
  }
  [[nodiscard]] double most(int begin, int end) const;  // points in one of these metres
};

}  // namespace understory
