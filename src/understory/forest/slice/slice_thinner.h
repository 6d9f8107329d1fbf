#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "understory/forest/cube_mean.h"
#include "understory/forest/stems/stem_detector.h"

namespace understory {

// Gathers points near breast height, one for each small cube: their mean, and the number of
// returns. Memory then grows with the surface seen, not with the number of returns. The order of
// points changes nothing.
class SliceThinner {
 public:
  // A cube of less than 1 mm counts as one of 1 mm.
  explicit SliceThinner(double cube_m);
  // Points more than 8 million cubes from zero are left out.
  void add(double x, double y, double height_m);
  // The lower corner of the cube that holds a place.
  [[nodiscard]] Eigen::Vector2d corner_of(double x, double y) const;
  // The thinned points in order of their cubes; empties the thinner.
  [[nodiscard]] std::vector<SlicePoint> take();

 private:
  struct Entry {
    std::uint64_t cube = 0;
    CubeMean mean;
  };
  void compact();
  [[nodiscard]] SlicePoint point_of(const Entry& entry) const;

  double cube_m_;
  std::vector<Entry> entries_;
  std::size_t limit_ = 1'000'000;
};

}  // namespace understory
