#pragma once

#include <Eigen/Core>
#include <cmath>
#include <vector>

#include "understory/geometry/plane/plane_grid.h"

namespace understory {

// The nearest target point of each source point while the source moves step by step, as in ICP. A
// search also tells how far every other target point is at least. As long as the source point has
// not moved by what that leaves, the result stands without another search. The same results as
// PlaneGrid::nearest. Not thread-safe.
class NearestPairs {
 public:
  // `height_weight` as in PlaneGrid::nearest. The grid must outlive this.
  NearestPairs(const PlaneGrid& grid, std::size_t sources, double height_weight)
      : grid_(grid), weight_(height_weight), known_(sources) {}

  // Of source point `i`, which is now at `at` (frame of the target).
  [[nodiscard]] PlaneGrid::Neighbour of(std::size_t i, const Eigen::Vector3d& at) {
    Known& known = known_[i];
    if (known.index >= 0) {
      const double squared = squared_m2(at, grid_.points()[static_cast<std::size_t>(known.index)]);
      // A nanometre for what rounding does to the sum.
      const double reach = known.others_m - std::sqrt(squared_m2(at, known.at)) - 1e-9;
      if (reach > 0.0 && squared < reach * reach) return {known.index, squared};
    }
    const PlaneGrid::Lone found = grid_.nearest_and_others(at, weight_);
    known = {at, found.nearest.index, found.others_m};
    return found.nearest;
  }

 private:
  struct Known {
    Eigen::Vector3d at = Eigen::Vector3d::Zero();  // where it was searched
    int index = -1;
    double others_m = 0.0;
  };
  [[nodiscard]] double squared_m2(const Eigen::Vector3d& a, const Eigen::Vector3d& b) const {
    const Eigen::Vector3d d = b - a;
    return d.x() * d.x() + d.y() * d.y() + weight_ * d.z() * d.z();
  }

  const PlaneGrid& grid_;
  double weight_;
  std::vector<Known> known_;
};

}  // namespace understory
