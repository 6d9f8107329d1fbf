#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "understory/forest/stems/stem_detector.h"

namespace understory {

// Points sorted by square of the ground, to gather those around a stem. Those of a square, and of
// squares side by side, follow each other.
class PointIndex {
 public:
  explicit PointIndex(std::vector<SlicePoint>& points) : end_(points.size()) {
    const auto is_before = [](const SlicePoint& a, const SlicePoint& b) {
      const std::uint64_t cell_a = key(a);
      const std::uint64_t cell_b = key(b);
      if (cell_a != cell_b) return cell_a < cell_b;
      if (a.x != b.x) return a.x < b.x;
      if (a.y != b.y) return a.y < b.y;
      return a.height_m != b.height_m ? a.height_m < b.height_m : a.returns < b.returns;
    };
    if (!std::is_sorted(points.begin(), points.end(), is_before))
      std::sort(points.begin(), points.end(), is_before);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const std::uint64_t cell = key(points[i]);
      if (cells_.empty() || cells_.back().key != cell) cells_.push_back({cell, i});
    }
  }

  // Calls visit(index) for the points of all squares within `reach` along either axis.
  template <typename Visit>
  void near(const Eigen::Vector2d& centre, double reach, const Visit& visit) const {
    const int r1 = cell(static_cast<float>(centre.y() + reach));
    const int c0 = cell(static_cast<float>(centre.x() - reach));
    const int c1 = cell(static_cast<float>(centre.x() + reach));
    for (int r = cell(static_cast<float>(centre.y() - reach)); r <= r1; ++r) {
      const std::size_t end = first_from(key(c1, r) + 1);
      for (std::size_t i = first_from(key(c0, r)); i < end; ++i)
        visit(i);
    }
  }

 private:
  struct Cell {
    std::uint64_t key;
    std::size_t first;  // of its points
  };
  [[nodiscard]] std::size_t first_from(std::uint64_t wanted) const {
    const auto found =
        std::lower_bound(cells_.begin(), cells_.end(), wanted,
                         [](const Cell& a, std::uint64_t value) { return a.key < value; });
    return found == cells_.end() ? end_ : found->first;
  }
  static int cell(float value) { return static_cast<int>(std::floor(value / 0.5F)); }
  static std::uint64_t key(int column, int row) {
    return static_cast<std::uint64_t>(static_cast<std::int64_t>(row) + (1LL << 31)) << 32 |
           static_cast<std::uint64_t>(static_cast<std::int64_t>(column) + (1LL << 31));
  }
  static std::uint64_t key(const SlicePoint& point) { return key(cell(point.x), cell(point.y)); }

  std::vector<Cell> cells_;
  std::size_t end_;
};

}  // namespace understory
