#pragma once

#include <Eigen/Core>
#include <vector>

#include "understory/geometry/plane/plane_grid.h"

namespace understory {

// Exact distances in the plane to the nearest of a few hundred points, for many thousand lookups.
// Each cell of a grid lists the points that can be nearest within it. Immutable.
class NearestTable {
 public:
  // Covers the points and `margin_m` around them; beyond, lookups are slower but as exact.
  NearestTable(const PlaneGrid& grid, double margin_m);

  [[nodiscard]] double squared_distance(double x, double y) const {
    const double u = (x - low_.x()) * per_cell_;
    const double v = (y - low_.y()) * per_cell_;
    if (!(u >= 0.0 && v >= 0.0 && u < columns_ && v < rows_)) return beyond(x, y);
    const std::size_t cell =
        static_cast<std::size_t>(static_cast<int>(v) * columns_ + static_cast<int>(u));
    double best = 1e300;
    for (int k = first_[cell]; k < first_[cell + 1]; ++k) {
      const Eigen::Vector2d& p = candidates_[static_cast<std::size_t>(k)];
      const double dx = p.x() - x;
      const double dy = p.y() - y;
      const double squared = dx * dx + dy * dy;
      best = squared < best ? squared : best;
    }
    return best;
  }

 private:
  [[nodiscard]] double beyond(double x, double y) const;

  const PlaneGrid& grid_;
  Eigen::Vector2d low_;
  double per_cell_ = 1.0;
  int columns_ = 1;
  int rows_ = 1;
  std::vector<int> first_;
  std::vector<Eigen::Vector2d> candidates_;
};

}  // namespace understory
