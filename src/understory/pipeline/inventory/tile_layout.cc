#include "understory/pipeline/inventory/tile_layout.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "understory/pipeline/pipeline_constants.h"

namespace understory {
namespace {

using namespace pipeline_constants::cloud_tiles;

int floor_by(std::int32_t number, int by) {
  return number >= 0 ? number / by : -((by - 1 - number) / by);
}

}  // namespace

TileLayout::TileLayout(std::map<Cell, std::uint64_t> points, double cell_m)
    : points_(std::move(points)), cell_m_(cell_m) {}

std::uint64_t TileLayout::most_points(int tile_cells) const {
  std::map<Cell, std::uint64_t> tiles;
  const int around = static_cast<int>(std::ceil(kAround / cell_m_));
  for (const auto& [index, points] : points_) {
    const auto first = [&](int number) { return floor_by(number - around, tile_cells); };
    const auto last = [&](int number) { return floor_by(number + around, tile_cells); };
    for (int row = first(index.first); row <= last(index.first); ++row) {
      for (int column = first(index.second); column <= last(index.second); ++column)
        tiles[{row, column}] += points;
    }
  }
  std::uint64_t most = 0;
  for (const auto& [index, count] : tiles)
    most = std::max(most, count);
  return most;
}

int TileLayout::largest_tile(double points) const {
  int best = 0;
  for (int cells = 1; cells <= kMostCellsOfTile; cells = std::max(cells + 1, cells * 5 / 4)) {
    if (static_cast<double>(most_points(cells)) > points) break;
    best = cells;
  }
  return best;
}

std::vector<GroundArea> TileLayout::tiles(int tile_cells) const {
  std::set<Cell> held;
  for (const auto& [index, points] : points_)
    held.insert({floor_by(index.first, tile_cells), floor_by(index.second, tile_cells)});
  if (held.size() == 1) return {GroundArea()};
  std::vector<GroundArea> tiles;
  const auto edge = [&](int number) { return cell_m_ * (tile_cells * number); };
  for (const auto& [row, column] : held)
    tiles.push_back({{edge(column), edge(row)}, {edge(column + 1), edge(row + 1)}});
  return tiles;
}

}  // namespace understory
