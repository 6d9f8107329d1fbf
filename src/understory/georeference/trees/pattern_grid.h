#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace understory {

// One tree as the search by pattern sees it.
struct PatternTree {
  Eigen::Vector2d at = Eigen::Vector2d::Zero();  // metres
  // Its size among its neighbours as a normal score: 0 is the median, 2 the largest of many. NaN
  // where unknown.
  double rank = std::numeric_limits<double>::quiet_NaN();
};

// Where a map of trees counts as seen: within `reach_m` of a tree, then `shrink_m` back from the
// edge of that. Gaps close, and the outline stays.
struct SeenArea {
  double reach_m = 16.0;
  double shrink_m = 0.0;
  double cell_m = 4.0;  // it is drawn in cells of this width, or wider ones on a large map
};

// Trees of a map in a grid: those near a place, and how densely they stand there. Metres.
// Immutable, thread-safe.
class PatternGrid {
 public:
  explicit PatternGrid(std::vector<PatternTree> trees, const SeenArea& seen = {});

  [[nodiscard]] const std::vector<PatternTree>& trees() const { return trees_; }
  // Trees per square metre around a place, smoothed over 12 m; 0 where the map does not reach.
  [[nodiscard]] double density(const Eigen::Vector2d& at) const;
  // Half of the trees stand in places less dense than this.
  [[nodiscard]] double median_density() const { return median_density_; }

  // Calls visit(index, squared distance) for each tree within the radius, in a fixed order.
  template <typename Visit>
  void near(const Eigen::Vector2d& at, double radius_m, const Visit& visit) const {
    const Eigen::Vector2d from = at - low_ - Eigen::Vector2d::Constant(radius_m);
    const Eigen::Vector2d to = at - low_ + Eigen::Vector2d::Constant(radius_m);
    const int last_row = clamped(to.y(), rows_);
    for (int row = clamped(from.y(), rows_); row <= last_row; ++row) {
      const std::size_t line = static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_);
      // The trees of neighbouring cells of a row lie one after another.
      const std::uint32_t end =
          first_[line + static_cast<std::size_t>(clamped(to.x(), columns_)) + 1];
      std::uint32_t k = first_[line + static_cast<std::size_t>(clamped(from.x(), columns_))];
      for (; k < end; ++k) {
        const double square = (trees_[k].at - at).squaredNorm();
        if (square <= radius_m * radius_m) visit(static_cast<std::size_t>(k), square);
      }
    }
  }
  // Where the tree `index` stands in the list that was given.
  [[nodiscard]] std::size_t given_index(std::size_t index) const { return given_[index]; }

 private:
  [[nodiscard]] int clamped(double along, int cells) const {
    const double cell = along / cell_m_;
    if (!(cell > 0.0)) return 0;
    return cell >= cells ? cells - 1 : static_cast<int>(cell);
  }
  void sort_into_cells(const std::vector<PatternTree>& given);
  [[nodiscard]] std::vector<float> seen_cells(const SeenArea& seen) const;
  void measure_density(const SeenArea& seen);

  Eigen::Vector2d low_ = Eigen::Vector2d::Zero();
  double cell_m_ = 4.0;
  int columns_ = 1;
  int rows_ = 1;
  std::vector<PatternTree> trees_;    // cell by cell
  std::vector<std::size_t> given_;    // of each, its index in the list given
  std::vector<std::uint32_t> first_;  // of each cell, and one more
  std::vector<float> density_;        // of each cell; 0 beyond the map
  double median_density_ = 0.0;
};

// The size of each tree among its neighbours within `radius_m`, as a normal score. `sizes` holds
// one size per place, NaN where unknown. NaN where fewer than five neighbours have a size.
[[nodiscard]] std::vector<double> local_ranks(const std::vector<Eigen::Vector2d>& places,
                                              const std::vector<double>& sizes, double radius_m);

// Quantile of the normal distribution, `share` in (0, 1), to 2e-9 (P. Acklam).
[[nodiscard]] double normal_quantile(double share);

}  // namespace understory
