#pragma once

#include <cstdint>
#include <vector>

#include "understory/forest/cell_grid.h"
#include "understory/forest/stem_detector.h"

namespace understory {

// What stands above each place: which metres over the ground hold points, and the highest one.
struct ColumnCell {
  std::uint64_t occupied = 0;  // bit i: points between i and i + 1 m above the ground (63: above)
  float highest_m = 0.0F;
  void add(double height_m) {
    if (!(height_m >= 0.0)) return;
    const int metre = height_m < 63.0 ? static_cast<int>(height_m) : 63;
    occupied |= 1ULL << metre;
    if (static_cast<float>(height_m) > highest_m) highest_m = static_cast<float>(height_m);
  }
};

// Height of each tree: the highest point that hangs together with its stem (gaps of at most
// 3 m) and is nearer to it than to any other stem. NaN where nothing is seen above the stem's
// slice, or where the points end as if cut off just above it: that is no tree top.
[[nodiscard]] std::vector<double> tree_heights(const CellGrid<ColumnCell>& columns,
                                               const std::vector<StemFit>& stems,
                                               double slices_end_m);

}  // namespace understory
