#include "understory/registration/icp/nearest_table.h"

#include <algorithm>
#include <cmath>

namespace understory {
namespace {

constexpr int kMaxCells = 256;  // along a side

}  // namespace

NearestTable::NearestTable(const PlaneGrid& grid, double margin_m) : grid_(grid) {
  const SparsePoints& points = grid.points();
  low_ = points.front().head<2>();
  Eigen::Vector2d high = low_;
  for (const Eigen::Vector3d& point : points) {
    low_ = low_.cwiseMin(point.head<2>());
    high = high.cwiseMax(point.head<2>());
  }
  low_.array() -= margin_m;
  high.array() += margin_m;
  const Eigen::Vector2d size = high - low_;
  // Half the spacing: short lists, and cheap to make.
  const double spacing = std::sqrt(size.x() * size.y() / static_cast<double>(points.size()));
  const double cell = std::max(0.5 * spacing, size.maxCoeff() / kMaxCells);
  per_cell_ = 1.0 / cell;
  columns_ = static_cast<int>(size.x() * per_cell_) + 1;
  rows_ = static_cast<int>(size.y() * per_cell_) + 1;
  first_.push_back(0);
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      const Eigen::Vector3d centre(low_.x() + (column + 0.5) * cell, low_.y() + (row + 0.5) * cell,
                                   0.0);
      const double nearest = std::sqrt(grid.nearest(centre, 1e9, 0.0).squared_m2);
      const double reach = nearest + std::sqrt(2.0) * cell * 1.000001;
      grid.around(centre, reach, [&](int i) {
        const Eigen::Vector2d p = points[static_cast<std::size_t>(i)].head<2>();
        if ((p - centre.head<2>()).squaredNorm() <= reach * reach) candidates_.push_back(p);
      });
      first_.push_back(static_cast<int>(candidates_.size()));
    }
  }
}

double NearestTable::beyond(double x, double y) const {
  return grid_.nearest({x, y, 0.0}, 1e9, 0.0).squared_m2;
}

}  // namespace understory
