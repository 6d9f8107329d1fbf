#include "understory/pipeline/inventory/cloud_tiles.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "understory/pipeline/inventory/tile_layout.h"
#include "understory/pipeline/pipeline_constants.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using namespace pipeline_constants::cloud_tiles;

// A tile of the user's size is made of whole cells.
double cell_for(const CloudTilesConfig& config, double extent_m) {
  if (config.size_m > 0.0) return config.size_m / std::max(1.0, std::floor(config.size_m / kCell));
  double cell = kCell;
  while (extent_m > kMostCellsAcross * cell)
    cell *= 2.0;
  return cell;
}

}  // namespace

void describe(ConfigTable& table, CloudTilesConfig& config) {
  table.add("size_m", config.size_m, {0.0, 10'000.0}, "m",
            "edge of the tiles in which a cloud is held; 0: none where it fits into max_memory_mb, "
            "else as large as that allows");
  table.add("max_memory_mb", config.max_memory_mb, {400.0, 1e6}, "MB",
            "memory that an inventory of a LAS, LAZ or E57 cloud should take: a larger cloud is "
            "sorted into tiles on disk first");
}

CloudTiles::CloudTiles(const std::filesystem::path& folder, const CloudTilesConfig& config,
                       double extent_m)
    : config_(config), scratch_(folder), cell_m_(cell_for(config, extent_m)) {}

CloudTiles::CellIndex CloudTiles::cell_of(const Eigen::Vector3d& point) const {
  constexpr double kFarthest = 1e9;
  const auto number = [&](double value) {
    return static_cast<std::int32_t>(
        std::clamp(std::floor(value / cell_m_), -kFarthest, kFarthest));
  };
  return {number(point.y()), number(point.x())};
}

GroundArea CloudTiles::area_of(const CellIndex& cell) const {
  return {{cell_m_ * cell.second, cell_m_ * cell.first},
          {cell_m_ * (cell.second + 1), cell_m_ * (cell.first + 1)}};
}

void CloudTiles::add(const TilePoint& point) {
  const Eigen::Vector3d at = world(point);
  const CellIndex index = cell_of(at);
  if (last_ == nullptr || index != last_index_) {
    last_ = &cells_[index];
    last_index_ = index;
  }
  if (!level_) {
    level_ = std::floor(at.z());
    lowest_ = highest_ = point.place.z();
  }
  lowest_ = std::min(lowest_, point.place.z());
  highest_ = std::max(highest_, point.place.z());
  most_intensity_ = std::max(most_intensity_, point.intensity);
  last_->buffer.push_back(point);
  ++last_->points;
  ++points_;
  ++buffered_;
  if (last_->buffer.size() >= kChunk) write_out(*last_);
  if (buffered_ < kMostBuffered) return;
  for (auto& [at_index, cell] : cells_)
    write_out(cell);
}

void CloudTiles::write_out(Cell& cell) {
  if (cell.buffer.empty()) return;
  cell.parts.push_back(scratch_.append(cell.buffer.data(), cell.buffer.size() * sizeof(TilePoint)));
  buffered_ -= cell.buffer.size();
  std::vector<TilePoint>().swap(cell.buffer);
}

void CloudTiles::finish(int threads) {
  for (auto& [index, cell] : cells_)
    write_out(cell);
  std::map<TileLayout::Cell, std::uint64_t> counts;
  for (const auto& [index, cell] : cells_)
    counts.emplace(index, cell.points);
  const TileLayout layout(std::move(counts), cell_m_);
  const double bytes = 1e6 * config_.max_memory_mb - kBaseBytes;
  for (tiles_in_parallel_ = std::max(1, threads); tiles_in_parallel_ > 1; --tiles_in_parallel_) {
    tile_cells_ = layout.largest_tile(bytes / kBytesPerPoint / tiles_in_parallel_);
    if (tile_cells_ * cell_m_ >= kSmallestSideBySide) break;
  }
  if (tiles_in_parallel_ == 1) tile_cells_ = layout.largest_tile(bytes / kBytesPerPoint);
  if (config_.size_m > 0.0) {
    tile_cells_ = std::max(1, static_cast<int>(std::lround(config_.size_m / cell_m_)));
    const double needed = static_cast<double>(layout.most_points(tile_cells_)) * kBytesPerPoint;
    tiles_in_parallel_ =
        std::clamp(static_cast<int>(bytes / std::max(1.0, needed)), 1, std::max(1, threads));
  } else if (tile_cells_ == 0) {
    throw ConfigError({fmt::format(
        "tiles.max_memory_mb: expected {:.0f} at least for this cloud: so much takes a tile of "
        "{:.0f} m of it with what is around",
        std::ceil((static_cast<double>(layout.most_points(1)) * kBytesPerPoint + kBaseBytes) / 1e6),
        cell_m_)});
  }
  tiles_ = layout.tiles(tile_cells_);
}

void CloudTiles::visit_cell(const Cell& cell, std::vector<TilePoint>& loaded,
                            const RecordVisitor& visit) const {
  for (const ScratchFile::Part& part : cell.parts) {
    loaded.resize(part.size / sizeof(TilePoint));
    scratch_.read(part, loaded.data());
    visit(loaded);
  }
}

void CloudTiles::visit_places(const Cell& cell, std::vector<TilePoint>& loaded,
                              std::vector<Eigen::Vector3d>& places,
                              const PointVisitor& visit) const {
  visit_cell(cell, loaded, [&](std::span<const TilePoint> points) {
    for (const TilePoint& point : points)
      places.push_back(world(point));
    if (places.size() < kBlock) return;
    visit(places);
    places.clear();
  });
}

void CloudTiles::all(const PointVisitor& visit) const {
  std::vector<TilePoint> loaded;
  std::vector<Eigen::Vector3d> places;
  for (const auto& [index, cell] : cells_)
    visit_places(cell, loaded, places, visit);
  if (!places.empty()) visit(places);
}

void CloudTiles::in(const GroundArea& area, const PointVisitor& visit) const {
  std::vector<TilePoint> loaded;
  std::vector<Eigen::Vector3d> places;
  for (const auto& [index, cell] : cells_) {
    const GroundArea own = area_of(index);
    if (area.touches(own.low, own.high)) visit_places(cell, loaded, places, visit);
  }
  if (!places.empty()) visit(places);
}

void CloudTiles::records_in(const GroundArea& area, const RecordVisitor& visit) const {
  std::vector<TilePoint> loaded;
  for (const auto& [index, cell] : cells_) {
    const GroundArea own = area_of(index);
    if (area.touches(own.low, own.high)) visit_cell(cell, loaded, visit);
  }
}

GroundArea CloudTiles::extent() const {
  GroundArea all{Eigen::Vector2d::Constant(GroundArea::kEndless),
                 Eigen::Vector2d::Constant(-GroundArea::kEndless)};
  for (const auto& [index, cell] : cells_) {
    const GroundArea own = area_of(index);
    all.low = all.low.cwiseMin(own.low);
    all.high = all.high.cwiseMax(own.high);
  }
  return all;
}

double CloudTiles::thickness_m() const {
  return static_cast<double>(highest_ - lowest_);
}

}  // namespace understory
