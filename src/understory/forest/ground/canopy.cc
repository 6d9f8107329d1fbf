#include "understory/forest/ground/canopy.h"

#include <algorithm>

namespace understory {

void CanopyCeiling::count(const Eigen::Vector2d& place, double height_m) {
  ++columns_.at(place.x(), place.y()).points[HeightColumn::metre_of(height_m)];
}

void CanopyCeiling::add(const CanopyCeiling& other) {
  columns_.merge(other.columns_, [](HeightColumn& own, const HeightColumn& cell) {
    for (std::size_t i = 0; i < own.points.size(); ++i)
      own.points[i] += cell.points[i];
  });
}

void CanopyCeiling::settle() {
  columns_.for_each([&](int column, int row, const HeightColumn& cell) {
    const int metre = cell.top(0, HeightColumn::kMetres);
    highest_.at((column + 0.5) * kCell, (row + 0.5) * kCell) = static_cast<std::int8_t>(metre);
  });
  columns_ = CellGrid<HeightColumn>(kCell);
}

bool CanopyCeiling::holds(const Eigen::Vector2d& place, double height_m) const {
  const std::int8_t* highest = highest_.find(place.x(), place.y());
  return highest != nullptr &&
         static_cast<int>(HeightColumn::metre_of(height_m)) <= static_cast<int>(*highest);
}

void CanopyGrid::add(const Eigen::Vector2d& place, double height_m) {
  float& highest = highest_.at(place.x(), place.y()).highest_m;
  highest = std::max(highest, static_cast<float>(height_m));
}

void CanopyGrid::add(const CanopyGrid& other) {
  highest_.merge(other.highest_, [](Cell& own, const Cell& cell) {
    own.highest_m = std::max(own.highest_m, cell.highest_m);
  });
}

Raster CanopyGrid::raster(double x0, double y0) const {
  return raster_over(highest_, x0, y0, [](Raster& canopy, std::size_t at, const Cell& cell) {
    if (cell.highest_m >= 0.0F) canopy.values[at] = cell.highest_m;
  });
}

}  // namespace understory
