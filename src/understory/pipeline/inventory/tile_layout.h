#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "understory/forest/ground_area.h"

namespace understory {

// How the cells of a cloud on disk are put together to square tiles that an inventory holds one at
// a time. World frame; the cell (0, 0) begins at the origin.
class TileLayout {
 public:
  using Cell = std::pair<std::int32_t, std::int32_t>;  // row, column

  // `points`: of each cell that has any; `cell_m`: edge of a cell, metres.
  TileLayout(std::map<Cell, std::uint64_t> points, double cell_m);

  // Points in the fullest tile of so many cells a side, with what is around it.
  [[nodiscard]] std::uint64_t most_points(int tile_cells) const;
  // Cells a side of the largest tile with so many points at most; 0: none.
  [[nodiscard]] int largest_tile(double points) const;
  // The tiles of so many cells a side that hold points, in order of y then x. A single endless one
  // where one tile holds all.
  [[nodiscard]] std::vector<GroundArea> tiles(int tile_cells) const;

 private:
  std::map<Cell, std::uint64_t> points_;
  double cell_m_;
};

}  // namespace understory
