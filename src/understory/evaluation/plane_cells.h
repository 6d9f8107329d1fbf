#pragma once

#include <algorithm>
#include <cmath>
#include <compare>
#include <cstddef>
#include <vector>

namespace understory {

// Places in the plane, sorted into square cells, so that those near a place are found in constant
// time. A place far away does not make the cells larger. Metres. Immutable, thread-safe.
class PlaneCells {
 public:
  // `x_of(k)` and `y_of(k)`: finite coordinates of the place k of `n`. `reach_m`: how far is looked
  // at most.
  template <typename X, typename Y>
  PlaneCells(std::size_t n, double reach_m, const X& x_of, const Y& y_of)
      // Slightly wider than the reach, so that rounding moves nothing beyond the next cell.
      : cell_m_(std::max(reach_m, 1e-6) * (1.0 + 1e-6)) {
    places_.reserve(n);
    for (std::size_t k = 0; k < n; ++k)
      places_.push_back({cell(y_of(k)), cell(x_of(k)), k});
    std::sort(places_.begin(), places_.end());
  }

  // Calls visit(k) for every place within the reach, and for some beyond it, in a fixed order.
  template <typename Visit>
  void around(double x, double y, const Visit& visit) const {
    const double column = cell(x);
    const double row = cell(y);
    for (const double r : {row - 1.0, row, row + 1.0}) {
      auto at = std::lower_bound(places_.begin(), places_.end(), Place{r, column - 1.0, 0});
      for (; at != places_.end() && at->row == r && at->column <= column + 1.0; ++at)
        visit(at->index);
    }
  }

 private:
  struct Place {
    double row;
    double column;
    std::size_t index;
    auto operator<=>(const Place&) const = default;  // NOLINT(modernize-use-nullptr)
  };
  [[nodiscard]] double cell(double coordinate) const { return std::floor(coordinate / cell_m_); }

  double cell_m_;
  std::vector<Place> places_;  // by rows
};

}  // namespace understory
