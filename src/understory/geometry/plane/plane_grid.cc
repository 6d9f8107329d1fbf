#include "understory/geometry/plane/plane_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace understory {
namespace {

constexpr int kMaxCells = 512;  // along a side; far outliers must not take the memory

}  // namespace

PlaneGrid::PlaneGrid(const SparsePoints& points) : points_(points) {
  if (points_.empty()) {
    first_.assign(2, 0);
    return;
  }
  low_ = points_.front().head<2>();
  Eigen::Vector2d high = low_;
  for (const Eigen::Vector3d& point : points_) {
    low_ = low_.cwiseMin(point.head<2>());
    high = high.cwiseMax(point.head<2>());
  }
  const Eigen::Vector2d size = (high - low_).cwiseMax(1e-3);
  cell_m_ = std::max(std::sqrt(size.x() * size.y() / static_cast<double>(points_.size())),
                     size.maxCoeff() / kMaxCells);
  columns_ = static_cast<int>(size.x() / cell_m_) + 1;
  rows_ = static_cast<int>(size.y() / cell_m_) + 1;
  std::vector<int> cell(points_.size());
  first_.assign(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_) + 1, 0);
  for (std::size_t i = 0; i < points_.size(); ++i) {
    cell[i] = row(points_[i].y()) * columns_ + column(points_[i].x());
    ++first_[static_cast<std::size_t>(cell[i]) + 1];
  }
  for (std::size_t k = 1; k < first_.size(); ++k)
    first_[k] += first_[k - 1];
  order_.resize(points_.size());
  std::vector<int> next(first_.begin(), first_.end() - 1);
  for (std::size_t i = 0; i < points_.size(); ++i)
    order_[static_cast<std::size_t>(next[static_cast<std::size_t>(cell[i])]++)] =
        static_cast<int>(i);
}

// A number that is none lies in the first cell.
int PlaneGrid::column(double x) const {
  const double cell = (x - low_.x()) / cell_m_;
  return cell > 0.0 ? static_cast<int>(std::min(cell, static_cast<double>(columns_ - 1))) : 0;
}

int PlaneGrid::row(double y) const {
  const double cell = (y - low_.y()) / cell_m_;
  return cell > 0.0 ? static_cast<int>(std::min(cell, static_cast<double>(rows_ - 1))) : 0;
}

PlaneGrid::Neighbour PlaneGrid::nearest(const Eigen::Vector3d& at, double limit_m,
                                        double height_weight) const {
  Neighbour best;
  best.squared_m2 = limit_m * limit_m;
  if (points_.empty()) return best;
  // Grows the square around the point until nothing outside can be nearer.
  double radius = 0.75 * cell_m_;
  double last = -1.0;
  while (last < limit_m) {
    radius = std::min(radius, limit_m);
    best = {-1, limit_m * limit_m};
    around(at, radius, [&](int i) {
      const Eigen::Vector3d d = points_[static_cast<std::size_t>(i)] - at;
      const double squared = d.x() * d.x() + d.y() * d.y() + height_weight * d.z() * d.z();
      if (squared < best.squared_m2 || (squared == best.squared_m2 && i < best.index))
        best = {i, squared};
    });
    if (best.index >= 0 && best.squared_m2 <= radius * radius) return best;
    last = radius;
    // The search ends at the latest when all cells have been seen.
    if (best.index >= 0)
      radius = std::max(std::sqrt(best.squared_m2), 1.0001 * radius);
    else
      radius *= 2.0;
    if (last > 2.0 * cell_m_ * (columns_ + rows_) + (at.head<2>() - low_).norm()) break;
  }
  return best;
}

PlaneGrid::Lone PlaneGrid::nearest_and_others(const Eigen::Vector3d& at,
                                              double height_weight) const {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  if (points_.empty() || !at.allFinite()) return {{}, kNone};
  // The far corner of the grid from here: a square that large holds every point.
  const double all = 2.0 * cell_m_ * (columns_ + rows_) + (at.head<2>() - low_).norm();
  for (double radius = 0.75 * cell_m_;; radius *= 2.0) {
    Neighbour best{-1, kNone};
    double second = kNone;
    around(at, radius, [&](int i) {
      const Eigen::Vector3d d = points_[static_cast<std::size_t>(i)] - at;
      const double squared = d.x() * d.x() + d.y() * d.y() + height_weight * d.z() * d.z();
      if (squared < best.squared_m2 || (squared == best.squared_m2 && i < best.index)) {
        second = best.squared_m2;
        best = {i, squared};
      } else {
        second = std::min(second, squared);
      }
    });
    const bool whole = radius > all;
    if (whole || (best.index >= 0 && best.squared_m2 <= radius * radius))
      return {best, std::sqrt(whole ? second : std::min(second, radius * radius))};
  }
}

}  // namespace understory
