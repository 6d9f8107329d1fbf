#include "understory/output/report/map_picture.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "understory/output/report/png.h"

namespace understory {
namespace {

constexpr int kGreys = 96;
constexpr int kGreens = 128;
constexpr double kFarthestM = 4e7;  // so that differences of columns stay integers
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

bool MapPicture::Box::contains(int column, int row) const {
  return column >= column0 && row >= row0 && column < column0 + columns && row < row0 + rows;
}

bool MapPicture::Box::contains(const Box& other) const {
  return contains(other.column0, other.row0) &&
         contains(other.column0 + other.columns - 1, other.row0 + other.rows - 1);
}

std::size_t MapPicture::Box::at(int column, int row) const {
  return static_cast<std::size_t>(row - row0) * static_cast<std::size_t>(columns) +
         static_cast<std::size_t>(column - column0);
}

double MapPicture::x0() const {
  return seen_.column0 * cell_m_;
}
double MapPicture::y0() const {
  return seen_.row0 * cell_m_;
}
double MapPicture::width_m() const {
  return seen_.columns * cell_m_;
}
double MapPicture::height_m() const {
  return seen_.rows * cell_m_;
}

std::array<double, 4> MapPicture::content_box() const {
  const int column1 = seen_.column0 + seen_.columns;
  const int row1 = seen_.row0 + seen_.rows;
  std::array<int, 4> box = {column1, row1, seen_.column0, seen_.row0};
  for (int row = seen_.row0; row < row1; ++row) {
    for (int column = seen_.column0; column < column1; ++column) {
      const Cell& cell = cells_[held_.at(column, row)];
      if (cell.ground + cell.vegetation == 0) continue;
      box = {std::min(box[0], column), std::min(box[1], row), std::max(box[2], column + 1),
             std::max(box[3], row + 1)};
    }
  }
  return {box[0] * cell_m_, box[1] * cell_m_, box[2] * cell_m_, box[3] * cell_m_};
}

void MapPicture::add(double x, double y, double z, double height_m) {
  if (!(std::abs(x) < kFarthestM && std::abs(y) < kFarthestM)) return;
  auto column = static_cast<int>(std::floor(x / cell_m_));
  auto row = static_cast<int>(std::floor(y / cell_m_));
  while (!seen_.contains(column, row)) {
    grow(column, row);
    column = static_cast<int>(std::floor(x / cell_m_));
    row = static_cast<int>(std::floor(y / cell_m_));
  }
  Cell& cell = cells_[held_.at(column, row)];
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
  if (seen_.columns > 0) {
    c0 = std::min(c0, seen_.column0);
    r0 = std::min(r0, seen_.row0);
    c1 = std::max(c1, seen_.column0 + seen_.columns);
    r1 = std::max(r1, seen_.row0 + seen_.rows);
  }
  const int most = 2 * ((largest_side_ + kBlock - 1) / kBlock) * kBlock;
  if (c1 - c0 > most || r1 - r0 > most) {
    coarsen();
    return;  // the caller finds its cell anew
  }
  seen_ = {c0, r0, c1 - c0, r1 - r0};
  if (held_.contains(seen_)) return;
  // A quarter more on each side, no larger than the picture may become.
  const int columns = std::min(most, seen_.columns + seen_.columns / 2);
  const int rows = std::min(most, seen_.rows + seen_.rows / 2);
  hold({c0 - (columns - seen_.columns) / 2, r0 - (rows - seen_.rows) / 2, columns, rows});
}

// Moves the cells into an array of that box; what lies outside of it is lost.
void MapPicture::hold(const Box& box) {
  std::vector<Cell> cells(static_cast<std::size_t>(box.columns) *
                          static_cast<std::size_t>(box.rows));
  const int column0 = std::max(box.column0, held_.column0);
  const int column1 = std::min(box.column0 + box.columns, held_.column0 + held_.columns);
  const int row0 = std::max(box.row0, held_.row0);
  const int row1 = std::min(box.row0 + box.rows, held_.row0 + held_.rows);
  for (int row = row0; row < row1 && column0 < column1; ++row) {
    std::copy_n(cells_.begin() + static_cast<std::ptrdiff_t>(held_.at(column0, row)),
                column1 - column0,
                cells.begin() + static_cast<std::ptrdiff_t>(box.at(column0, row)));
  }
  cells_.swap(cells);
  held_ = box;
}

void MapPicture::coarsen() {
  const auto half = [](int value) { return static_cast<int>(std::floor(value / 2.0)); };
  Box coarse{half(seen_.column0), half(seen_.row0), 0, 0};
  coarse.columns = half(seen_.column0 + seen_.columns - 1) - coarse.column0 + 1;
  coarse.rows = half(seen_.row0 + seen_.rows - 1) - coarse.row0 + 1;
  std::vector<Cell> cells(static_cast<std::size_t>(coarse.columns) *
                          static_cast<std::size_t>(coarse.rows));
  for (int row = seen_.row0; row < seen_.row0 + seen_.rows; ++row) {
    for (int column = seen_.column0; column < seen_.column0 + seen_.columns; ++column) {
      const Cell& from = cells_[held_.at(column, row)];
      Cell& to = cells[coarse.at(half(column), half(row))];
      if (from.ground > 0) {
        to.ground_z = to.ground == 0 ? from.ground_z : std::min(to.ground_z, from.ground_z);
      }
      to.ground += from.ground;
      to.vegetation += from.vegetation;
      to.top_m = std::max(to.top_m, from.top_m);
    }
  }
  cells_.swap(cells);
  seen_ = coarse;
  held_ = coarse;
  cell_m_ *= 2.0;
}

std::string MapPicture::png() const {
  MapPicture small = *this;
  while (std::max(small.seen_.columns, small.seen_.rows) > largest_side_)
    small.coarsen();
  small.hold(small.seen_);
  return small.encode();
}

// Ground as if lit from the north-west. The cells held must be those of the picture.
std::string MapPicture::encode() const {
  const auto cell_at = [&](int column, int row) -> const Cell* {
    if (column < 0 || row < 0 || column >= held_.columns || row >= held_.rows) return nullptr;
    return &cells_[held_.at(held_.column0 + column, held_.row0 + row)];
  };
  float top = 1.0F;
  for (const Cell& cell : cells_)
    top = std::max(top, cell.top_m);
  PalettePicture picture{held_.columns, held_.rows, palette(), {}};
  picture.pixels.assign(cells_.size(), 0);
  for (int row = 0; row < held_.rows; ++row) {
    for (int column = 0; column < held_.columns; ++column) {
      const Cell& cell = *cell_at(column, row);
      std::uint8_t& pixel = picture.at(column, held_.rows - 1 - row);
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
