#pragma once

#include "understory/forest/cell_grid.h"
#include "understory/forest/ground/height_column.h"
#include "understory/geometry/raster.h"

namespace understory {

// How far up real points reach over each square of 2 m: what is above are ghosts of other pulses
// (see HeightColumn). First all points are counted, then any may be asked for.
class CanopyCeiling {
 public:
  void count(const Eigen::Vector2d& place, double height_m);  // height >= 0
  // What another one counted, before `settle`.
  void add(const CanopyCeiling& other);
  void settle();  // after the last `count`
  [[nodiscard]] bool holds(const Eigen::Vector2d& place, double height_m) const;

 private:
  static constexpr double kCell = 2.0;
  CellGrid<HeightColumn> columns_{kCell};
  CellGrid<std::int8_t> highest_{kCell};  // real metre
};

// The highest point above the ground in each cell; memory grows with the area.
class CanopyGrid {
 public:
  explicit CanopyGrid(double cell_m) : highest_(cell_m) {}
  void add(const Eigen::Vector2d& place, double height_m);  // height >= 0
  void add(const CanopyGrid& other);                        // of the same cells
  // NaN where there was no point. (x0, y0): origin of the places in the raster's frame, metres.
  [[nodiscard]] Raster raster(double x0, double y0) const;

 private:
  struct Cell {
    float highest_m = -1.0F;
  };
  CellGrid<Cell> highest_;
};

}  // namespace understory
