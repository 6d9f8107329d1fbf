#pragma once

#include <Eigen/Core>
#include <cmath>
#include <limits>
#include <vector>

namespace understory {

// A north-up grid of heights in the world frame. Row 0 is the southern edge, column 0 the western
// one; the value of a cell belongs to its centre. NaN where nothing is known.
struct Raster {
  double x0 = 0.0;  // western edge, metres
  double y0 = 0.0;  // southern edge, metres
  double cell_m = 1.0;
  int columns = 0;
  int rows = 0;
  std::vector<float> values;  // row by row, relative to z0
  double z0 = 0.0;            // so that floats keep their precision at any height above sea

  [[nodiscard]] bool empty() const { return values.empty(); }
  [[nodiscard]] bool contains(int column, int row) const {
    return column >= 0 && row >= 0 && column < columns && row < rows;
  }
  [[nodiscard]] std::size_t index(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
           static_cast<std::size_t>(column);
  }
  [[nodiscard]] int column_of(double x) const {
    return static_cast<int>(std::floor((x - x0) / cell_m));
  }
  [[nodiscard]] int row_of(double y) const {
    return static_cast<int>(std::floor((y - y0) / cell_m));
  }
  // Height of the cell that holds (x, y), NaN outside.
  [[nodiscard]] double cell_value(double x, double y) const {
    const int column = column_of(x);
    const int row = row_of(y);
    if (!contains(column, row)) return std::numeric_limits<double>::quiet_NaN();
    return z0 + static_cast<double>(values[index(column, row)]);
  }
  // Bilinear between the centres of cells. Held constant beyond the outer centres. NaN further than
  // one cell outside, or where less than a quarter (by weight) of the four cells is known.
  [[nodiscard]] double interpolate(double x, double y) const;
};

// Heights over the cells of `above`, whose own are heights above the ground: those of the ground
// are added. NaN where either is. Both in one frame.
[[nodiscard]] Raster absolute_heights(const Raster& ground, const Raster& above);

}  // namespace understory
