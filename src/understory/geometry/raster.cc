#include "understory/geometry/raster.h"

#include <algorithm>

namespace understory {

double Raster::interpolate(double x, double y) const {
  const double u = (x - x0) / cell_m - 0.5;
  const double v = (y - y0) / cell_m - 0.5;
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  if (columns == 0 || rows == 0) return kUnknown;
  if (!(u >= -1.5 && v >= -1.5 && u <= columns + 0.5 && v <= rows + 0.5)) return kUnknown;
  const double uc = std::clamp(u, 0.0, columns - 1.0);
  const double vc = std::clamp(v, 0.0, rows - 1.0);
  const int column = std::min(static_cast<int>(uc), std::max(columns - 2, 0));
  const int row = std::min(static_cast<int>(vc), std::max(rows - 2, 0));
  const double fu = uc - column;
  const double fv = vc - row;
  if (column + 1 < columns && row + 1 < rows) {
    // All four are there, nearly everywhere: the same sums in the same order as below.
    const float* south = values.data() + index(column, row);
    const float* north = south + columns;
    if (std::isfinite(south[0] + south[1] + north[0] + north[1])) {
      const double w00 = (1.0 - fu) * (1.0 - fv);
      const double w10 = fu * (1.0 - fv);
      const double w01 = (1.0 - fu) * fv;
      const double w11 = fu * fv;
      double sum = w00 * static_cast<double>(south[0]);
      sum += w10 * static_cast<double>(south[1]);
      sum += w01 * static_cast<double>(north[0]);
      sum += w11 * static_cast<double>(north[1]);
      return z0 + sum / (w00 + w10 + w01 + w11);
    }
  }
  double sum = 0.0;
  double weights = 0.0;
  for (int j = 0; j < 2; ++j) {
    for (int i = 0; i < 2; ++i) {
      const double weight = (i == 0 ? 1.0 - fu : fu) * (j == 0 ? 1.0 - fv : fv);
      if (weight <= 0.0 || !contains(column + i, row + j)) continue;
      const auto value = static_cast<double>(values[index(column + i, row + j)]);
      if (!std::isfinite(value)) continue;
      sum += weight * value;
      weights += weight;
    }
  }
  // At the border of the known a part of the four cells is enough, as long as one is near.
  return weights >= 0.25 ? z0 + sum / weights : kUnknown;
}

Raster absolute_heights(const Raster& ground, const Raster& above) {
  Raster surface = above;
  surface.z0 = ground.z0;
  for (int row = 0; row < above.rows; ++row) {
    for (int column = 0; column < above.columns; ++column) {
      const double x = above.x0 + (column + 0.5) * above.cell_m;
      const double y = above.y0 + (row + 0.5) * above.cell_m;
      const std::size_t at = above.index(column, row);
      const double height = above.z0 + static_cast<double>(above.values[at]);
      surface.values[at] = static_cast<float>(ground.interpolate(x, y) - ground.z0 + height);
    }
  }
  return surface;
}

}  // namespace understory
