#pragma once

#include <cstdint>
#include <vector>

#include "understory/forest/stems/stem_detector.h"

namespace understory {

// Gathers points near breast height, one per small cube (their mean, with the number of returns),
// so that memory goes with the surface seen, not with the number of returns.
class SliceThinner {
 public:
  explicit SliceThinner(double cube_m) : cube_m_(cube_m) {}
  void add(double x, double y, double height_m);
  // The thinned points in order of their cubes; empties the thinner.
  [[nodiscard]] std::vector<SlicePoint> take();

 private:
  struct Entry {
    std::uint64_t cube = 0;
    float x = 0.0F, y = 0.0F, height_m = 0.0F;
    std::uint32_t returns = 0;
  };
  void compact();

  double cube_m_;
  std::vector<Entry> entries_;
  std::size_t limit_ = 1'000'000;
};

}  // namespace understory
