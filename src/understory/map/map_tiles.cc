#include "understory/map/map_tiles.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>

#include "understory/geometry/voxel_index.h"
#include "understory/util/error.h"

namespace understory {
namespace {

constexpr std::uint64_t kBufferedPoints = 2'000'000;  // 48 MB over all tiles
constexpr std::size_t kBlock = 1 << 16;  // points; 1.5 MB, so that they stay in the cache
constexpr std::size_t kKeysAhead = 32;

constexpr double kGridStepsPerMetre = 4096.0;

}  // namespace

double on_map_grid(double metres) {
  return std::nearbyint(metres * kGridStepsPerMetre) / kGridStepsPerMetre;
}

Eigen::Vector3d on_map_grid(const Eigen::Vector3d& place) {
  return {on_map_grid(place.x()), on_map_grid(place.y()), on_map_grid(place.z())};
}

struct MapTiles::Record {
  float x, y, z;
  std::uint16_t intensity;
  bool of_neighbour;
  TimeNs stamp;
};

struct MapTiles::Tile {
  std::vector<Record> buffer;
  std::uint64_t written = 0;  // records in its file
};

MapTiles::MapTiles(std::filesystem::path folder, const Config& config, StoredPlace stored_place)
    : folder_(std::move(folder)), config_(config), stored_place_(std::move(stored_place)) {
  std::error_code error;
  std::filesystem::remove_all(folder_, error);
  std::filesystem::create_directories(folder_, error);
  if (error) throw OutputError(folder_.string(), "cannot be created: " + error.message());
}

MapTiles::~MapTiles() {
  std::error_code ignored;  // leftovers of a temporary folder are no reason to fail
  std::filesystem::remove_all(folder_, ignored);
}

void MapTiles::add(const MapPoint& point) {
  UNDERSTORY_CHECK(!thinned_);
  const double i = std::floor(point.x / config_.tile_m);
  const double j = std::floor(point.y / config_.tile_m);
  if (!(std::abs(i) < 1e9 && std::abs(j) < 1e9)) return;  // not a finite place
  const TileIndex index{static_cast<std::int32_t>(i), static_cast<std::int32_t>(j)};
  add_to(index, point, false);
  ++points_added_;
  // Which neighbours are so near: -1, 0 or 1 tile further.
  const auto side = [&](double value, double tile, int step) {
    const double from_edge = value - tile * config_.tile_m;
    return step == 0 || (step < 0 ? from_edge < config_.border_m
                                  : config_.tile_m - from_edge <= config_.border_m);
  };
  for (int dx = -1; config_.border_m > 0.0 && dx <= 1; ++dx) {
    for (int dy = -1; dy <= 1; ++dy) {
      if ((dx != 0 || dy != 0) && side(point.x, i, dx) && side(point.y, j, dy))
        add_to({index.first + dx, index.second + dy}, point, true);
    }
  }
  if (buffered_ < kBufferedPoints) return;
  for (auto& [at, tile] : tiles_)
    write_out(at, tile);
  buffered_ = 0;
}

void MapTiles::add_to(TileIndex index, const MapPoint& point, bool of_neighbour) {
  tiles_[index].buffer.push_back({static_cast<float>(point.x - corner(index.first)),
                                  static_cast<float>(point.y - corner(index.second)),
                                  static_cast<float>(point.z), point.intensity, of_neighbour,
                                  point.stamp});
  ++buffered_;
}

// Of the tile of this number along an axis.
double MapTiles::corner(std::int32_t tiles) const {
  return on_map_grid(tiles * config_.tile_m);
}

std::filesystem::path MapTiles::file_of(TileIndex index) const {
  return folder_ / (std::to_string(index.first) + "_" + std::to_string(index.second) + ".tile");
}

void MapTiles::write_out(TileIndex index, Tile& tile) {
  if (tile.buffer.empty()) return;
  const std::filesystem::path path = file_of(index);
  std::ofstream file(path, std::ios::binary | std::ios::app);
  file.write(reinterpret_cast<const char*>(tile.buffer.data()),
             static_cast<std::streamsize>(tile.buffer.size() * sizeof(Record)));
  file.close();
  if (!file) throw OutputError(path.string(), "cannot be written (is the disk full?)");
  tile.written += tile.buffer.size();
  std::vector<Record>().swap(tile.buffer);
}

// Those of a tile that was never written lie in memory; `loaded` holds those that were.
std::span<const MapTiles::Record> MapTiles::records_of(TileIndex index, const Tile& tile,
                                                       std::vector<Record>& loaded) const {
  if (tile.written == 0) return tile.buffer;
  loaded.resize(tile.written);
  const std::filesystem::path path = file_of(index);
  std::ifstream file(path, std::ios::binary);
  file.read(reinterpret_cast<char*>(loaded.data()),
            static_cast<std::streamsize>(tile.written * sizeof(Record)));
  if (!file) throw InputError(path.string(), "", "a temporary tile cannot be read back");
  loaded.insert(loaded.end(), tile.buffer.begin(), tile.buffer.end());
  return loaded;
}

std::vector<MapTiles::Record> MapTiles::thinned(std::span<const Record> records) const {
  VoxelIndex taken;
  const auto cell = [&](float value) {
    return voxel_floor(static_cast<double>(value) / config_.thin_m);
  };
  const auto key_of = [&](const Record& r) { return voxel_key(cell(r.x), cell(r.y), cell(r.z)); };
  // The index is larger than the cache: its memory is asked for some points ahead.
  std::array<std::uint64_t, kKeysAhead> keys;
  std::vector<Record> kept;
  for (std::size_t begin = 0; begin < records.size(); begin += kKeysAhead) {
    const std::size_t count = std::min(kKeysAhead, records.size() - begin);
    for (std::size_t i = 0; i < count; ++i)
      taken.prefetch(keys[i] = key_of(records[begin + i]));
    for (std::size_t i = 0; i < count; ++i) {
      if (taken.find(keys[i]) != VoxelIndex::kNone) continue;
      taken.set(keys[i], 0);
      kept.push_back(records[begin + i]);
    }
  }
  return kept;
}

void MapTiles::move_to_stored(TileIndex index, std::vector<Record>& records) const {
  const Eigen::Vector3d from(corner(index.first), corner(index.second), 0.0);
  for (Record& r : records) {
    const Eigen::Vector3d place = from + Eigen::Vector3f(r.x, r.y, r.z).cast<double>();
    const Eigen::Vector3f stored = (stored_place_(place) - from).cast<float>();
    r.x = stored.x();
    r.y = stored.y();
    r.z = stored.z();
  }
}

void MapTiles::thin_all() {
  thinned_ = true;
  if (config_.thin_m <= 0.0 && !stored_place_) return;
  std::vector<Record> loaded;
  for (auto& [index, tile] : tiles_) {
    const std::span<const Record> all = records_of(index, tile, loaded);
    std::vector<Record> kept =
        config_.thin_m > 0.0 ? thinned(all) : std::vector<Record>(all.begin(), all.end());
    if (stored_place_) move_to_stored(index, kept);
    const bool on_disk = tile.written > 0;
    if (on_disk) {
      std::filesystem::remove(file_of(index));
      tile.written = 0;
    }
    tile.buffer = std::move(kept);
    if (on_disk) write_out(index, tile);
  }
}

std::vector<std::pair<MapTiles::TileIndex, const MapTiles::Tile*>> MapTiles::tiles_in_order()
    const {
  std::vector<std::pair<TileIndex, const Tile*>> tiles;
  for (const auto& [index, tile] : tiles_)
    tiles.emplace_back(index, &tile);
  std::sort(tiles.begin(), tiles.end(), [](const auto& a, const auto& b) {
    return std::pair(a.first.second, a.first.first) < std::pair(b.first.second, b.first.first);
  });
  return tiles;
}

void MapTiles::for_each(const std::function<void(TileIndex, const std::vector<MapPoint>&)>& visit) {
  if (!thinned_) thin_all();
  std::vector<MapPoint> points;
  std::vector<Record> loaded;
  for (const auto& [index, tile] : tiles_in_order()) {
    points.clear();
    for (const Record& r : records_of(index, *tile, loaded)) {
      points.push_back({corner(index.first) + static_cast<double>(r.x),
                        corner(index.second) + static_cast<double>(r.y), static_cast<double>(r.z),
                        r.stamp, r.intensity, r.of_neighbour});
    }
    visit(index, points);
  }
}

void MapTiles::for_each_place(const std::function<void(std::span<const Eigen::Vector3d>)>& visit) {
  if (!thinned_) thin_all();
  std::vector<Eigen::Vector3d> places;
  std::vector<Record> loaded;
  for (const auto& [index, tile] : tiles_in_order()) {
    const double x0 = corner(index.first);
    const double y0 = corner(index.second);
    const std::span<const Record> records = records_of(index, *tile, loaded);
    for (std::size_t begin = 0; begin < records.size(); begin += kBlock) {
      places.clear();
      for (const Record& r : records.subspan(begin, std::min(kBlock, records.size() - begin))) {
        places.emplace_back(x0 + static_cast<double>(r.x), y0 + static_cast<double>(r.y),
                            static_cast<double>(r.z));
      }
      visit(places);
    }
  }
}

}  // namespace understory
