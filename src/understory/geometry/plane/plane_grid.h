#pragma once

#include <Eigen/Core>
#include <vector>

namespace understory {

// Sparse points, metres; double, as there are few of them.
using SparsePoints = std::vector<Eigen::Vector3d>;

// Nearest neighbours among a few hundred points that are spread over a plane (tree stems): buckets
// of a horizontal grid, about one point each. Immutable, thread-safe.
class PlaneGrid {
 public:
  struct Neighbour {
    int index = -1;  // -1: none within the limit
    double squared_m2 = 0.0;
  };
  // The nearest of all, and what no other point lies nearer than.
  struct Lone {
    Neighbour nearest;
    double others_m = 0.0;
  };

  explicit PlaneGrid(const SparsePoints& points);

  [[nodiscard]] const SparsePoints& points() const { return points_; }
  // Nearest point to `at`, not farther than `limit_m`: in the plane (`height_weight` 0) or in space
  // (1); the squared distance is dx^2 + dy^2 + height_weight dz^2. Of equal ones the first. Nothing
  // is near a place that is no number.
  [[nodiscard]] Neighbour nearest(const Eigen::Vector3d& at, double limit_m,
                                  double height_weight) const;
  // The same without a limit; its distances are those of that metric.
  [[nodiscard]] Lone nearest_and_others(const Eigen::Vector3d& at, double height_weight) const;
  // Calls visit(index) for every point within `radius_m` in the plane, and some beyond.
  template <typename Visit>
  void around(const Eigen::Vector3d& at, double radius_m, const Visit& visit) const {
    const int x0 = column(at.x() - radius_m);
    const int x1 = column(at.x() + radius_m);
    const int y0 = row(at.y() - radius_m);
    const int y1 = row(at.y() + radius_m);
    for (int y = y0; y <= y1; ++y) {
      const std::size_t line = static_cast<std::size_t>(y) * static_cast<std::size_t>(columns_);
      const int begin = first_[line + static_cast<std::size_t>(x0)];
      const int end = first_[line + static_cast<std::size_t>(x1) + 1];
      for (int k = begin; k < end; ++k)
        visit(order_[static_cast<std::size_t>(k)]);
    }
  }

 private:
  [[nodiscard]] int column(double x) const;
  [[nodiscard]] int row(double y) const;

  SparsePoints points_;
  Eigen::Vector2d low_ = Eigen::Vector2d::Zero();
  double cell_m_ = 1.0;
  int columns_ = 1;
  int rows_ = 1;
  std::vector<int> first_;  // of each cell into order_, row by row
  std::vector<int> order_;
};

}  // namespace understory
