#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "understory/geometry/raster.h"

namespace understory {

// A grid of small records over an area whose bounds are not known beforehand. A block of cells is
// made where something first falls into it. Cells hold what does not depend on the order of work
// inside the cloud. Not thread-safe.
template <typename Cell>
class CellGrid {
 public:
  static constexpr int kBlock = 32;
  struct Bounds {
    int column0 = 0, row0 = 0, columns = 0, rows = 0;
  };

  explicit CellGrid(double cell_m) : cell_m_(cell_m) {}
  [[nodiscard]] double cell_m() const { return cell_m_; }

  Cell& at(double x, double y) {
    const auto column = static_cast<int>(std::floor(x / cell_m_));
    const auto row = static_cast<int>(std::floor(y / cell_m_));
    const std::pair<int, int> key{floor_div(row), floor_div(column)};
    if (last_ == nullptr || key != last_key_) {
      auto& block = blocks_[key];
      if (block == nullptr) block = std::make_unique<Block>();
      last_ = block.get();
      last_key_ = key;
    }
    ++last_->points;
    return last_->cells[index_in(key, column, row)];
  }

  // Null where nothing has been.
  [[nodiscard]] const Cell* find(double x, double y) const {
    const auto column = static_cast<int>(std::floor(x / cell_m_));
    const auto row = static_cast<int>(std::floor(y / cell_m_));
    const auto block = blocks_.find({floor_div(row), floor_div(column)});
    if (block == blocks_.end()) return nullptr;
    return &block->second->cells[index_in(block->first, column, row)];
  }

  // The blocks' bounds in cells. A few stray points far away must not make the area huge. Where it
  // has more than `most` cells, blocks with fewer than `few` points are left out. If that is not
  // enough, those with fewer than four times as many are, and so on.
  [[nodiscard]] Bounds bounds(std::uint64_t most, std::uint64_t few) const {
    Bounds all = bounds_of(0);
    for (std::uint64_t least = std::max<std::uint64_t>(1, few); cells_of(all) > most; least *= 4)
      all = bounds_of(least);
    return all;
  }

  // Adds another grid with cells of the same size: visit(own cell, other cell).
  template <typename Visit>
  void merge(const CellGrid& other, const Visit& visit) {
    for (const auto& [key, block] : other.blocks_) {
      auto& own = blocks_[key];
      if (own == nullptr) own = std::make_unique<Block>();
      own->points += block->points;
      for (std::size_t i = 0; i < own->cells.size(); ++i)
        visit(own->cells[i], block->cells[i]);
    }
  }

  template <typename Visit>
  void for_each(const Visit& visit) const {
    for (const auto& [key, block] : blocks_) {
      for (int j = 0; j < kBlock; ++j) {
        for (int i = 0; i < kBlock; ++i) {
          visit(key.second * kBlock + i, key.first * kBlock + j,
                block->cells[static_cast<std::size_t>(j * kBlock + i)]);
        }
      }
    }
  }

 private:
  struct Block {
    std::array<Cell, kBlock * kBlock> cells{};
    std::uint64_t points = 0;
  };
  static int floor_div(int value) {
    return value >= 0 ? value / kBlock : -((kBlock - 1 - value) / kBlock);
  }
  static std::size_t index_in(const std::pair<int, int>& block, int column, int row) {
    return static_cast<std::size_t>((row - block.first * kBlock) * kBlock + column -
                                    block.second * kBlock);
  }
  static std::uint64_t cells_of(const Bounds& bounds) {
    return static_cast<std::uint64_t>(bounds.columns) * static_cast<std::uint64_t>(bounds.rows);
  }
  [[nodiscard]] Bounds bounds_of(std::uint64_t few) const {
    bool first = true;
    std::pair<int, int> low{0, 0};
    std::pair<int, int> high{0, 0};
    for (const auto& [key, block] : blocks_) {
      if (block->points < few) continue;
      low =
          first ? key : std::pair{std::min(low.first, key.first), std::min(low.second, key.second)};
      high = first ? key
                   : std::pair{std::max(high.first, key.first), std::max(high.second, key.second)};
      first = false;
    }
    if (first) return {};
    return {low.second * kBlock, low.first * kBlock, (high.second - low.second + 1) * kBlock,
            (high.first - low.first + 1) * kBlock};
  }

  double cell_m_;
  std::map<std::pair<int, int>, std::unique_ptr<Block>> blocks_;
  Block* last_ = nullptr;
  std::pair<int, int> last_key_{};
};

// A raster over the cells' bounds: (x0, y0) is where the grid's origin lies in the raster's frame,
// metres. All NaN at first; `visit(raster, index, cell)` may put a value at `index` for each cell.
template <typename Cell, typename Visit>
Raster raster_over(const CellGrid<Cell>& cells, double x0, double y0, const Visit& visit) {
  constexpr std::uint64_t kMostCells = 24'000'000;  // 96 MB of heights; 15 km² in cells of 0.8 m
  constexpr std::uint64_t kStray = 20;              // points of a block that may be left out
  const auto bounds = cells.bounds(kMostCells, kStray);
  Raster raster;
  raster.cell_m = cells.cell_m();
  raster.x0 = x0 + bounds.column0 * raster.cell_m;
  raster.y0 = y0 + bounds.row0 * raster.cell_m;
  raster.columns = bounds.columns;
  raster.rows = bounds.rows;
  raster.values.assign(
      static_cast<std::size_t>(raster.columns) * static_cast<std::size_t>(raster.rows),
      std::numeric_limits<float>::quiet_NaN());
  cells.for_each([&](int column, int row, const Cell& cell) {
    const int c = column - bounds.column0;
    const int r = row - bounds.row0;
    if (raster.contains(c, r)) visit(raster, raster.index(c, r), cell);
  });
  return raster;
}

}  // namespace understory
