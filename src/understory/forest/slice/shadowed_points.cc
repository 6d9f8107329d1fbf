#include "understory/forest/slice/shadowed_points.h"

#include <cstdint>

#include "understory/forest/cell_grid.h"
#include "understory/forest/stem_constants.h"

namespace understory {
namespace {

using namespace stem_constants::shadowed_points;

struct SquareCount {
  std::uint32_t below = 0;
  std::uint32_t from = 0;
};

// Whether hardly a point lies below, in the square at a place and those around it.
bool over_shadow(const CellGrid<SquareCount>& counts, double x, double y) {
  double below = 0.0;
  double from = 0.0;
  for (const double dy : {-kSquare, 0.0, kSquare}) {
    for (const double dx : {-kSquare, 0.0, kSquare}) {
      const SquareCount* square = counts.find(x + dx, y + dy);
      if (square == nullptr) continue;
      below += square->below;
      from += square->from;
    }
  }
  return below <= kBelowShare * from;
}

}  // namespace

std::vector<SlicePoint> points_over_shadows(const std::vector<SlicePoint>& slices,
                                            const std::vector<SlicePoint>& above, double lowest_m,
                                            double highest_m) {
  CellGrid<SquareCount> counts(kSquare);
  for (const std::vector<SlicePoint>* list : {&slices, &above}) {
    for (const SlicePoint& point : *list) {
      const auto height = static_cast<double>(point.height_m);
      if (height >= highest_m) continue;
      SquareCount& square = counts.at(static_cast<double>(point.x), static_cast<double>(point.y));
      ++(height < lowest_m ? square.below : square.from);
    }
  }
  CellGrid<bool> shadows(kSquare);
  counts.for_each([&](int column, int row, const SquareCount& square) {
    if (square.from == 0) return;
    const double x = (column + 0.5) * kSquare;
    const double y = (row + 0.5) * kSquare;
    shadows.at(x, y) = over_shadow(counts, x, y);
  });
  std::vector<SlicePoint> points;
  for (const std::vector<SlicePoint>* list : {&slices, &above}) {
    for (const SlicePoint& point : *list) {
      const auto height = static_cast<double>(point.height_m);
      if (height < lowest_m || height >= highest_m) continue;
      const bool* shadow = shadows.find(static_cast<double>(point.x), static_cast<double>(point.y));
      if (shadow != nullptr && *shadow) points.push_back(point);
    }
  }
  return points;
}

double shadow_reach_m() {
  return 2.0 * kSquare;
}

}  // namespace understory
