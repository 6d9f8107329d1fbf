#include "understory/forest/tree_heights.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace understory {
namespace {

constexpr double kCrownReach = 1.5;  // metres around the stem in which a top is looked for
constexpr double kLargestGap = 3.0;  // metres without points that a crown may begin after
constexpr double kLeastAbove = 1.5;  // metres over the slices: less is no tree top

// Place of a stem at a height; the lean near the ground is not carried far up, trees straighten.
Eigen::Vector2d place_at(const StemFit& stem, double height) {
  return stem.centre + std::min(height - 1.3, 6.0) * stem.slope;
}

}  // namespace

std::vector<double> tree_heights(const CellGrid<ColumnCell>& columns,
                                 const std::vector<StemFit>& stems, double slices_end_m) {
  std::vector<std::uint64_t> occupied(stems.size(), 0);
  std::vector<std::vector<float>> tops(stems.size());
  columns.for_each([&](int column, int row, const ColumnCell& cell) {
    if (cell.occupied == 0) return;
    const Eigen::Vector2d here((column + 0.5) * columns.cell_m(), (row + 0.5) * columns.cell_m());
    std::size_t nearest = stems.size();
    double least = kCrownReach;
    // Stems are sorted by x.
    const double reach = kCrownReach + 3.0;
    auto it = std::lower_bound(stems.begin(), stems.end(), here.x() - reach,
                               [](const StemFit& s, double x) { return s.centre.x() < x; });
    for (; it != stems.end() && it->centre.x() <= here.x() + reach; ++it) {
      const double distance = (place_at(*it, static_cast<double>(cell.highest_m)) - here).norm();
      if (distance >= least) continue;
      least = distance;
      nearest = static_cast<std::size_t>(it - stems.begin());
    }
    if (nearest == stems.size()) return;
    occupied[nearest] |= cell.occupied;
    tops[nearest].push_back(cell.highest_m);
  });
  std::vector<double> heights(stems.size(), std::numeric_limits<double>::quiet_NaN());
  for (std::size_t i = 0; i < stems.size(); ++i) {
    int metre = static_cast<int>(slices_end_m) - 1;
    int last = metre;
    for (; metre < 64 && metre - last <= static_cast<int>(kLargestGap); ++metre) {
      if ((occupied[i] >> metre & 1U) != 0) last = metre;
    }
    double top = 0.0;
    for (const float z : tops[i]) {
      if (static_cast<double>(z) < last + 1.0 || last == 63)
        top = std::max(top, static_cast<double>(z));
    }
    if (top >= slices_end_m + kLeastAbove) heights[i] = top;
  }
  return heights;
}

}  // namespace understory
