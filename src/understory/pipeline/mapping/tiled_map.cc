#include "understory/pipeline/mapping/tiled_map.h"

#include <algorithm>
#include <cstdint>
#include <map>

#include "understory/pipeline/inventory/tile_layout.h"
#include "understory/pipeline/pipeline_constants.h"

namespace understory {

using namespace pipeline_constants::tiled_map;

TiledMap::TiledMap(MapTiles& tiles, double most_bytes, const std::filesystem::path& folder)
    : tiles_(tiles), areas_(1) {
  if (most_bytes <= 0.0) return;
  std::uint64_t points = 0;
  std::map<TileLayout::Cell, std::uint64_t> counts;
  for (const auto& [index, count] : tiles.sizes()) {
    indices_.push_back(index);
    counts[{index.second, index.first}] = count;
    points += count;
  }
  if (static_cast<double>(points) * kBytesPerPointWhole <= most_bytes) return;
  const TileLayout layout(std::move(counts), tiles.tile_m());
  areas_ = layout.tiles(std::max(1, layout.largest_tile(most_bytes / kBytesPerPoint)));
  if (areas_.size() > 1) scratch_.emplace(folder);
}

void TiledMap::all(const PointVisitor& visit) const {
  tiles_.for_each_place(visit);
}

void TiledMap::in(const GroundArea& area, const PointVisitor& visit) const {
  if (areas_.size() == 1) return all(visit);
  const GroundArea held = area.grown(kBesideTileM);
  for (const MapTiles::TileIndex& index : indices_) {
    const Eigen::Vector2d low = tiles_.tile_m() * Eigen::Vector2d(index.first, index.second);
    if (held.touches(low, low + Eigen::Vector2d::Constant(tiles_.tile_m())))
      tiles_.for_each_place_in(index, visit);
  }
}

}  // namespace understory
