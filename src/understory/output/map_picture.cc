#include "understory/output/map_picture.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "understory/output/png.h"

namespace understory {
namespace {

constexpr int kGreys = 96;
constexpr int kGreens = 128;
constexpr int kBlock = 64;  // the grid grows by whole blocks, so that it does not grow often

std::vector<std::array<std::uint8_t, 3>> palette() {
  std::vector<std::array<std::uint8_t, 3>> colours = {{255, 255, 255}};
  for (int i = 0; i < kGreys; ++i) {
    const auto grey = static_cast<std::uint8_t>(70 + 150 * i / (kGreys - 1));
    colours.push_back({grey, grey, grey});
  }
  for (int i = 0; i < kGreens; ++i) {  // low dark, high light
    const double u = static_cast<double>(i) / (kGreens - 1);
    colours.push_back({static_cast<std::uint8_t>(18 + 130 * u),
                       static_cast<std::uint8_t>(74 + 130 * u),
                       static_cast<std::uint8_t>(32 + 55 * u)});
  }
  return colours;
}

}  // namespace

MapPicture::MapPicture(double finest_cell_m, int largest_side)
    : cell_m_(finest_cell_m), largest_side_(largest_side) {}

double MapPicture::x0() const {
  return column0_ * cell_m_;
}
double MapPicture::y0() const {
  return row0_ * cell_m_;
}
double MapPicture::width_m() const {
  return columns_ * cell_m_;
}
double MapPicture::height_m() const {
  return rows_ * cell_m_;
}

std::array<double, 4> MapPicture::content_box() const {
  std::array<int, 4> box = {columns_, rows_, 0, 0};
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      const Cell& cell = cells_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                                static_cast<std::size_t>(column)];
      if (cell.ground + cell.vegetation == 0) continue;
      box = {std::min(box[0], column), std::min(box[1], row), std::max(box[2], column + 1),
             std::max(box[3], row + 1)};
    }
  }
  return {(column0_ + box[0]) * cell_m_, (row0_ + box[1]) * cell_m_, (column0_ + box[2]) * cell_m_,
          (row0_ + box[3]) * cell_m_};
}

void MapPicture::add(double x, double y, double z, double height_m) {
  if (!std::isfinite(x) || !std::isfinite(y)) return;
  auto column = static_cast<int>(std::floor(x / cell_m_));
  auto row = static_cast<int>(std::floor(y / cell_m_));
  while (cells_.empty() || column < column0_ || row < row0_ || column >= column0_ + columns_ ||
         row >= row0_ + rows_) {
    grow(column, row);
    column = static_cast<int>(std::floor(x / cell_m_));
    row = static_cast<int>(std::floor(y / cell_m_));
  }
  Cell& cell = cells_[static_cast<std::size_t>(row - row0_) * static_cast<std::size_t>(columns_) +
                      static_cast<std::size_t>(column - column0_)];
  ++count_;
  constexpr double kVegetation = 0.3;
  const auto height = static_cast<float>(std::isnan(height_m) ? 1.0 : height_m);
  if (height_m <= kVegetation) {
    const auto level = static_cast<float>(z);
    cell.ground_z = cell.ground == 0 ? level : std::min(cell.ground_z, level);
    ++cell.ground;
  } else {
    cell.top_m = std::max(cell.top_m, height);
    ++cell.vegetation;
  }
}

// Makes room for a cell, in whole blocks; coarsens first where the picture would become too large.
void MapPicture::grow(int column, int row) {
  const auto down = [](int value) {
    return static_cast<int>(std::floor(static_cast<double>(value) / kBlock)) * kBlock;
  };
  int c0 = down(column);
  int r0 = down(row);
  int c1 = c0 + kBlock;
  int r1 = r0 + kBlock;
  if (!cells_.empty()) {
    c0 = std::min(c0, column0_);
    r0 = std::min(r0, row0_);
    c1 = std::max(c1, column0_ + columns_);
    r1 = std::max(r1, row0_ + rows_);
  }
  const int most = 2 * ((largest_side_ + kBlock - 1) / kBlock) * kBlock;
  if (c1 - c0 > most || r1 - r0 > most) {
    coarsen();
    return;  // the caller finds its cell anew
  }
  std::vector<Cell> cells(static_cast<std::size_t>(c1 - c0) * static_cast<std::size_t>(r1 - r0));
  for (int j = 0; j < rows_; ++j) {
    std::copy_n(
        cells_.begin() + static_cast<std::ptrdiff_t>(j) * columns_, columns_,
        cells.begin() + static_cast<std::ptrdiff_t>(j + row0_ - r0) * (c1 - c0) + (column0_ - c0));
  }
  cells_.swap(cells);
  column0_ = c0;
  row0_ = r0;
  columns_ = c1 - c0;
  rows_ = r1 - r0;
}

void MapPicture::coarsen() {
  const auto half = [](int value) { return static_cast<int>(std::floor(value / 2.0)); };
  const int c0 = half(column0_);
  const int r0 = half(row0_);
  const int columns = half(column0_ + columns_ - 1) - c0 + 1;
  const int rows = half(row0_ + rows_ - 1) - r0 + 1;
  std::vector<Cell> cells(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
  for (int j = 0; j < rows_; ++j) {
    for (int i = 0; i < columns_; ++i) {
      const Cell& from = cells_[static_cast<std::size_t>(j) * static_cast<std::size_t>(columns_) +
                                static_cast<std::size_t>(i)];
      Cell& to =
          cells[static_cast<std::size_t>(half(j + row0_) - r0) * static_cast<std::size_t>(columns) +
                static_cast<std::size_t>(half(i + column0_) - c0)];
      if (from.ground > 0) {
        to.ground_z = to.ground == 0 ? from.ground_z : std::min(to.ground_z, from.ground_z);
      }
      to.ground += from.ground;
      to.vegetation += from.vegetation;
      to.top_m = std::max(to.top_m, from.top_m);
    }
  }
  cells_.swap(cells);
  column0_ = c0;
  row0_ = r0;
  columns_ = columns;
  rows_ = rows;
  cell_m_ *= 2.0;
}

std::string MapPicture::png() const {
  MapPicture small = *this;
  while (std::max(small.columns_, small.rows_) > largest_side_)
    small.coarsen();
  return small.encode();
}

// Ground as if lit from the north-west.
std::string MapPicture::encode() const {
  const auto cell_at = [&](int column, int row) -> const Cell* {
    if (column < 0 || row < 0 || column >= columns_ || row >= rows_) return nullptr;
    return &cells_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                   static_cast<std::size_t>(column)];
  };
  float top = 1.0F;
  for (const Cell& cell : cells_)
    top = std::max(top, cell.top_m);
  PalettePicture picture{columns_, rows_, palette(), {}};
  picture.pixels.assign(cells_.size(), 0);
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      const Cell& cell = *cell_at(column, row);
      std::uint8_t& pixel = picture.at(column, rows_ - 1 - row);
      if (cell.vegetation > 0) {
        const double u = std::sqrt(static_cast<double>(cell.top_m / top));
        pixel = static_cast<std::uint8_t>(1 + kGreys + std::lround(u * (kGreens - 1)));
      } else if (cell.ground > 0) {
        double rise = 0.0;
        const Cell* west = cell_at(column - 1, row);
        const Cell* north = cell_at(column, row + 1);
        if (west != nullptr && west->ground > 0)
          rise += static_cast<double>(cell.ground_z - west->ground_z);
        if (north != nullptr && north->ground > 0)
          rise += static_cast<double>(cell.ground_z - north->ground_z);
        const double light = std::clamp(0.62 - 0.6 * rise / cell_m_, 0.0, 1.0);
        pixel = static_cast<std::uint8_t>(1 + std::lround(light * (kGreys - 1)));
      }
    }
  }
  return encode_png(picture);
}

}  // namespace understory
