#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace understory {

// The map seen from above, gathered point by point in bounded memory. The grid starts fine and is
// coarsened by two whenever the stand outgrows it. Ground grey by its shape, vegetation green by
// its height. Deterministic: does not depend on the order of points.
class MapPicture {
 public:
  explicit MapPicture(double finest_cell_m = 0.05, int largest_side = 1400);

  // `height_m` above ground, NaN where the ground is unknown. A point farther from the origin than
  // 40,000 km along an axis is left out, and so is one that is no number.
  void add(double x, double y, double z, double height_m);

  [[nodiscard]] bool empty() const { return count_ == 0; }
  [[nodiscard]] double cell_m() const { return cell_m_; }
  // Western, southern edge and size in metres of the picture.
  [[nodiscard]] double x0() const;
  [[nodiscard]] double y0() const;
  [[nodiscard]] double width_m() const;
  [[nodiscard]] double height_m() const;
  // West, south, east, north of the cells that hold something, metres.
  [[nodiscard]] std::array<double, 4> content_box() const;
  // Transparent where nothing was seen.
  [[nodiscard]] std::string png() const;

 private:
  struct Cell {
    float ground_z = 0.0F;
    float top_m = 0.0F;
    std::uint32_t ground = 0;
    std::uint32_t vegetation = 0;
  };
  // Cells from a first column and row on, in multiples of the cell.
  struct Box {
    int column0 = 0, row0 = 0, columns = 0, rows = 0;
    [[nodiscard]] bool contains(int column, int row) const;
    [[nodiscard]] std::size_t at(int column, int row) const;
  };
  // Blocks of cells that come to be where something falls into them: a growing picture copies none.
  class Cells {
   public:
    // Makes place for the blocks of a box, which holds all that was covered before.
    void cover(const Box& box);
    // A cell of the box.
    [[nodiscard]] Cell& at(int column, int row);
    // Null outside of the box, and where no block is.
    [[nodiscard]] const Cell* find(int column, int row) const;
    // Calls `visit(column, row, cell)` with each cell that holds something.
    template <typename Visit>
    void for_each(const Visit& visit) const;

   private:
    Box covered_;                            // in blocks
    std::vector<std::vector<Cell>> blocks_;  // empty: none
  };
  void grow(int column, int row);
  void coarsen();
  [[nodiscard]] std::string encode() const;

  double cell_m_;
  int largest_side_;
  Box seen_;  // of the picture
  Cells cells_;
  std::uint64_t count_ = 0;
};

}  // namespace understory
