#include "understory/output/report/map_picture.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "understory/output/report/png.h"

namespace understory {
namespace {

constexpr int kGreys = 96;
constexpr int kGreens = 128;
constexpr double kFarthestM = 4e7;  // so that differences of columns stay integers
constexpr int kBlockBits = 6;
constexpr int kBlock = 1 << kBlockBits;  // cells along the edge of a block

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

std::size_t place_in_block(int column, int row) {
  return static_cast<std::size_t>((row & (kBlock - 1)) * kBlock + (column & (kBlock - 1)));
}

}  // namespace

MapPicture::MapPicture(double finest_cell_m, int largest_side)
    : cell_m_(finest_cell_m), largest_side_(largest_side) {}

bool MapPicture::Box::contains(int column, int row) const {
  return column >= column0 && row >= row0 && column < column0 + columns && row < row0 + rows;
}

std::size_t MapPicture::Box::at(int column, int row) const {
  return static_cast<std::size_t>(row - row0) * static_cast<std::size_t>(columns) +
         static_cast<std::size_t>(column - column0);
}

void MapPicture::Cells::cover(const Box& box) {
  Box wider{box.column0 >> kBlockBits, box.row0 >> kBlockBits, 0, 0};
  wider.columns = ((box.column0 + box.columns - 1) >> kBlockBits) + 1 - wider.column0;
  wider.rows = ((box.row0 + box.rows - 1) >> kBlockBits) + 1 - wider.row0;
  std::vector<std::vector<Cell>> blocks(static_cast<std::size_t>(wider.columns) *
                                        static_cast<std::size_t>(wider.rows));
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    const int column = covered_.column0 + static_cast<int>(i) % covered_.columns;
    const int row = covered_.row0 + static_cast<int>(i) / covered_.columns;
    blocks[wider.at(column, row)] = std::move(blocks_[i]);
  }
  blocks_ = std::move(blocks);
  covered_ = wider;
}

MapPicture::Cell& MapPicture::Cells::at(int column, int row) {
  std::vector<Cell>& block = blocks_[covered_.at(column >> kBlockBits, row >> kBlockBits)];
  if (block.empty()) block.resize(std::size_t{kBlock} * kBlock);
  return block[place_in_block(column, row)];
}

const MapPicture::Cell* MapPicture::Cells::find(int column, int row) const {
  if (!covered_.contains(column >> kBlockBits, row >> kBlockBits)) return nullptr;
  const auto& block = blocks_[covered_.at(column >> kBlockBits, row >> kBlockBits)];
  return block.empty() ? nullptr : &block[place_in_block(column, row)];
}

template <typename Visit>
void MapPicture::Cells::for_each(const Visit& visit) const {
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    const int column0 = (covered_.column0 + static_cast<int>(i) % covered_.columns) * kBlock;
    const int row0 = (covered_.row0 + static_cast<int>(i) / covered_.columns) * kBlock;
    for (std::size_t k = 0; k < blocks_[i].size(); ++k) {
      const Cell& cell = blocks_[i][k];
      if (cell.ground + cell.vegetation == 0) continue;
      visit(column0 + static_cast<int>(k) % kBlock, row0 + static_cast<int>(k) / kBlock, cell);
    }
  }
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
  cells_.for_each([&](int column, int row, const Cell&) {
    box = {std::min(box[0], column), std::min(box[1], row), std::max(box[2], column + 1),
           std::max(box[3], row + 1)};
  });
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
  Cell& cell = cells_.at(column, row);
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
  cells_.cover(seen_);
}

void MapPicture::coarsen() {
  const auto half = [](int value) { return value >> 1; };  // rounds down, also below 0
  Box coarse{half(seen_.column0), half(seen_.row0), 0, 0};
  coarse.columns = half(seen_.column0 + seen_.columns - 1) - coarse.column0 + 1;
  coarse.rows = half(seen_.row0 + seen_.rows - 1) - coarse.row0 + 1;
  Cells cells;
  cells.cover(coarse);
  cells_.for_each([&](int column, int row, const Cell& from) {
    Cell& to = cells.at(half(column), half(row));
    if (from.ground > 0) {
      to.ground_z = to.ground == 0 ? from.ground_z : std::min(to.ground_z, from.ground_z);
    }
    to.ground += from.ground;
    to.vegetation += from.vegetation;
    to.top_m = std::max(to.top_m, from.top_m);
  });
  cells_ = std::move(cells);
  seen_ = coarse;
  cell_m_ *= 2.0;
}

std::string MapPicture::png() const {
  if (std::max(seen_.columns, seen_.rows) <= largest_side_) return encode();
  MapPicture small = *this;
  while (std::max(small.seen_.columns, small.seen_.rows) > largest_side_)
    small.coarsen();
  return small.encode();
}

// Ground as if lit from the north-west.
std::string MapPicture::encode() const {
  float top = 1.0F;
  cells_.for_each([&](int, int, const Cell& cell) { top = std::max(top, cell.top_m); });
  PalettePicture picture{seen_.columns, seen_.rows, palette(), {}};
  picture.pixels.assign(
      static_cast<std::size_t>(seen_.columns) * static_cast<std::size_t>(seen_.rows), 0);
  cells_.for_each([&](int column, int row, const Cell& cell) {
    std::uint8_t& pixel = picture.at(column - seen_.column0, seen_.rows - 1 - (row - seen_.row0));
    if (cell.vegetation > 0) {
      const double u = std::sqrt(static_cast<double>(cell.top_m / top));
      pixel = static_cast<std::uint8_t>(1 + kGreys + std::lround(u * (kGreens - 1)));
      return;
    }
    double rise = 0.0;
    for (const Cell* beside : {cells_.find(column - 1, row), cells_.find(column, row + 1)}) {
      if (beside != nullptr && beside->ground > 0)
        rise += static_cast<double>(cell.ground_z - beside->ground_z);
    }
    const double light = std::clamp(0.62 - 0.6 * rise / cell_m_, 0.0, 1.0);
    pixel = static_cast<std::uint8_t>(1 + std::lround(light * (kGreys - 1)));
  });
  return encode_png(picture);
}

}  // namespace understory
