#include "understory/forest/ground/unseen_ground.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "understory/forest/forest_constants.h"

namespace understory {
namespace {

using namespace forest_constants::unseen_ground;

// Appends how far the cells between two others of a line lie from their mean, metres.
void append_bends(const Raster& seen, int columns, int rows, std::vector<float>& bends) {
  for (int row = rows; row + rows < seen.rows; ++row) {
    for (int column = columns; column + columns < seen.columns; ++column) {
      const float before = seen.values[seen.index(column - columns, row - rows)];
      const float after = seen.values[seen.index(column + columns, row + rows)];
      const float bend = seen.values[seen.index(column, row)] - 0.5F * (before + after);
      if (std::isfinite(bend)) bends.push_back(std::abs(bend));
    }
  }
}

double roughness(const Raster& seen) {
  const int lag = std::max(1, static_cast<int>(std::lround(kLag / seen.cell_m)));
  std::vector<float> bends;
  append_bends(seen, lag, 0, bends);
  append_bends(seen, 0, lag, bends);
  if (bends.size() < kLeastBends) return 0.0;
  const auto middle = bends.begin() + static_cast<std::ptrdiff_t>(bends.size() / 2);
  std::nth_element(bends.begin(), middle, bends.end());
  return static_cast<double>(*middle) / kMedianOfNormal;
}

}  // namespace

UnseenGround::UnseenGround(const Raster& seen)
    : grid_{seen.x0, seen.y0, seen.cell_m, seen.columns, seen.rows, {}, seen.z0},
      seen_(seen.values.size()),
      roughness_m_(roughness(seen)) {
  for (std::size_t i = 0; i < seen_.size(); ++i)
    seen_[i] = std::isfinite(seen.values[i]) ? 1 : 0;
}

double UnseenGround::sd_m(double x, double y) const {
  if (seen_.empty()) return 0.0;
  const int column = std::clamp(grid_.column_of(x), 0, grid_.columns - 1);
  const int row = std::clamp(grid_.row_of(y), 0, grid_.rows - 1);
  const int farthest = static_cast<int>(std::ceil(kFarthest / grid_.cell_m));
  double nearest = static_cast<double>(farthest);  // cells
  // Ring by ring: no cell of a ring is nearer than its number.
  for (int ring = 0; ring < nearest; ++ring) {
    for (int j = -ring; j <= ring; ++j) {
      const int step = std::abs(j) == ring ? 1 : std::max(1, 2 * ring);
      for (int i = -ring; i <= ring; i += step) {
        if (grid_.contains(column + i, row + j) && seen_[grid_.index(column + i, row + j)] != 0)
          nearest = std::min(nearest, std::hypot(i, j));
      }
    }
  }
  return kSdPerRoughness * roughness_m_ * nearest * grid_.cell_m / kLag;
}

}  // namespace understory
