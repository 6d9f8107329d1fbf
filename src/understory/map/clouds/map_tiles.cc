#include "understory/map/clouds/map_tiles.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <optional>
#include <string>
#include <utility>

#include "understory/geometry/voxel_index.h"
#include "understory/util/error.h"

namespace understory {
namespace {

constexpr std::uint64_t kBufferedPoints = 2'000'000;  // 48 MB over all tiles
constexpr std::size_t kBlock = 1 << 16;  // points; 1.5 MB, so that they stay in the cache
constexpr std::size_t kKeysAhead = 32;
constexpr double kShareOfBuffers = 0.25;  // of most_bytes; the rest is for the index that thins
constexpr double kIndexBytes = 64.0;      // of a VoxelIndex for each key, while it grows
constexpr int kMostStrips = 64;
constexpr double kGridStepsPerMetre = 512.0;

void append(const std::filesystem::path& path, const void* bytes, std::size_t size) {
  std::ofstream file(path, std::ios::binary | std::ios::app);
  file.write(static_cast<const char*>(bytes), static_cast<std::streamsize>(size));
  file.close();
  if (!file) throw OutputError(path.string(), "cannot be written (is the disk full?)");
}

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

MapTiles::MapTiles(std::filesystem::path folder, const Config& config)
    : folder_(std::move(folder)), config_(config) {
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
  if (buffered_ < buffered_at_most()) return;
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
  append(path, tile.buffer.data(), tile.buffer.size() * sizeof(Record));
  tile.written += tile.buffer.size();
  std::vector<Record>().swap(tile.buffer);
}

std::uint64_t MapTiles::buffered_at_most() const {
  if (config_.most_bytes <= 0.0) return kBufferedPoints;
  // Buffers grow by doubling.
  const double points = kShareOfBuffers * config_.most_bytes / (2.0 * sizeof(Record));
  return std::clamp<std::uint64_t>(static_cast<std::uint64_t>(points), kBlock, kBufferedPoints);
}

// In blocks; those on disk come before those in memory.
void MapTiles::for_each_record(TileIndex index, const Tile& tile,
                               const RecordVisitor& visit) const {
  if (tile.written > 0) {
    const std::filesystem::path path = file_of(index);
    std::ifstream file(path, std::ios::binary);
    std::vector<Record> block;
    for (std::uint64_t done = 0; done < tile.written; done += block.size()) {
      block.resize(std::min<std::uint64_t>(kBlock, tile.written - done));
      file.read(reinterpret_cast<char*>(block.data()),
                static_cast<std::streamsize>(block.size() * sizeof(Record)));
      if (!file) throw InputError(path.string(), "", "a temporary tile cannot be read back");
      visit(block);
    }
  }
  const std::span<const Record> waiting = tile.buffer;
  for (std::size_t begin = 0; begin < waiting.size(); begin += kBlock)
    visit(waiting.subspan(begin, std::min(kBlock, waiting.size() - begin)));
}

// Which records of a tile are the first in their cubes. A tile whose index would take too much is
// gone through strip by strip; a cube lies in one strip.
std::vector<bool> MapTiles::kept_of(TileIndex index, const Tile& tile) const {
  const std::uint64_t count = tile.written + tile.buffer.size();
  const auto cell = [&](float value) {
    return voxel_floor(static_cast<double>(value) / config_.thin_m);
  };
  int strips = 1;
  if (config_.most_bytes > 0.0) {
    const double index_bytes = kIndexBytes * static_cast<double>(count);
    strips =
        static_cast<int>(std::ceil(index_bytes / ((1.0 - kShareOfBuffers) * config_.most_bytes)));
    strips = std::clamp(strips, 1, kMostStrips);
  }
  const int columns = cell(static_cast<float>(config_.tile_m)) + 1;
  const auto strip_of = [&](int column) {
    return strips == 1 ? 0 : std::clamp(column, 0, columns - 1) * strips / columns;
  };
  std::vector<bool> kept(count, false);
  for (int strip = 0; strip < strips; ++strip) {
    VoxelIndex taken;
    std::uint64_t at = 0;
    // The index is larger than the cache: its memory is asked for some points ahead.
    std::array<std::uint64_t, kKeysAhead> keys;
    for_each_record(index, tile, [&](std::span<const Record> records) {
      for (std::size_t begin = 0; begin < records.size(); begin += kKeysAhead) {
        const std::size_t here = std::min(kKeysAhead, records.size() - begin);
        for (std::size_t i = 0; i < here; ++i) {
          const Record& r = records[begin + i];
          taken.prefetch(keys[i] = voxel_key(cell(r.x), cell(r.y), cell(r.z)));
        }
        for (std::size_t i = 0; i < here; ++i, ++at) {
          if (strip_of(cell(records[begin + i].x)) != strip) continue;
          if (taken.find(keys[i]) != VoxelIndex::kNone) continue;
          taken.set(keys[i], 0);
          kept[at] = true;
        }
      }
    });
  }
  return kept;
}

MapTiles::Record MapTiles::stored(TileIndex index, Record record) const {
  if (!config_.on_grid) return record;
  const Eigen::Vector3d from(corner(index.first), corner(index.second), 0.0);
  const Eigen::Vector3d place = from + Eigen::Vector3f(record.x, record.y, record.z).cast<double>();
  const Eigen::Vector3f moved = (on_map_grid(place) - from).cast<float>();
  record.x = moved.x();
  record.y = moved.y();
  record.z = moved.z();
  return record;
}

void MapTiles::thin(TileIndex index, Tile& tile) {
  const std::vector<bool> kept = config_.thin_m > 0.0
                                     ? kept_of(index, tile)
                                     : std::vector<bool>(tile.written + tile.buffer.size(), true);
  const bool on_disk = tile.written > 0;
  const std::filesystem::path path = file_of(index);
  std::filesystem::path thinned = path;
  thinned += ".thin";
  std::vector<Record> left;
  std::uint64_t at = 0;
  std::uint64_t written = 0;
  const auto write = [&] {
    append(thinned, left.data(), left.size() * sizeof(Record));
    written += left.size();
    left.clear();
  };
  for_each_record(index, tile, [&](std::span<const Record> records) {
    for (const Record& record : records) {
      if (kept[at++]) left.push_back(stored(index, record));
    }
    if (on_disk && left.size() >= kBlock) write();
  });
  if (on_disk) {
    write();
    left.shrink_to_fit();
    std::filesystem::rename(thinned, path);
  }
  tile.written = written;
  tile.buffer = std::move(left);
}

void MapTiles::thin_all() {
  thinned_ = true;
  for (auto& [index, tile] : tiles_) {
    if (config_.most_bytes > 0.0) write_out(index, tile);
    if (config_.thin_m > 0.0 || config_.on_grid) thin(index, tile);
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
  std::vector<MapPoint> points;
  std::optional<TileIndex> last;
  const auto hand_over = [&] {
    if (last) visit(*last, points);
    points.clear();
  };
  for_each_block([&](TileIndex index, std::span<const MapPoint> block) {
    if (last != index) hand_over();
    last = index;
    points.insert(points.end(), block.begin(), block.end());
  });
  hand_over();
}

void MapTiles::for_each_block(
    const std::function<void(TileIndex, std::span<const MapPoint>)>& visit) {
  if (!thinned_) thin_all();
  std::vector<MapPoint> points;
  for (const auto& [index, tile] : tiles_in_order()) {
    const double x0 = corner(index.first);
    const double y0 = corner(index.second);
    for_each_record(index, *tile, [&, at = index](std::span<const Record> records) {
      points.clear();
      for (const Record& r : records) {
        points.push_back({x0 + static_cast<double>(r.x), y0 + static_cast<double>(r.y),
                          static_cast<double>(r.z), r.stamp, r.intensity, r.of_neighbour});
      }
      visit(at, points);
    });
  }
}

void MapTiles::for_each_place_of(
    TileIndex index, const Tile& tile,
    const std::function<void(std::span<const Eigen::Vector3d>)>& visit) const {
  const double x0 = corner(index.first);
  const double y0 = corner(index.second);
  std::vector<Eigen::Vector3d> places;
  for_each_record(index, tile, [&](std::span<const Record> records) {
    places.clear();
    for (const Record& r : records) {
      places.emplace_back(x0 + static_cast<double>(r.x), y0 + static_cast<double>(r.y),
                          static_cast<double>(r.z));
    }
    visit(places);
  });
}

void MapTiles::for_each_place(const std::function<void(std::span<const Eigen::Vector3d>)>& visit) {
  if (!thinned_) thin_all();
  for (const auto& [index, tile] : tiles_in_order())
    for_each_place_of(index, *tile, visit);
}

void MapTiles::for_each_place_in(
    TileIndex index, const std::function<void(std::span<const Eigen::Vector3d>)>& visit) {
  if (!thinned_) thin_all();
  const auto found = tiles_.find(index);
  if (found != tiles_.end()) for_each_place_of(index, found->second, visit);
}

std::vector<std::pair<MapTiles::TileIndex, std::uint64_t>> MapTiles::sizes() {
  if (!thinned_) thin_all();
  std::vector<std::pair<TileIndex, std::uint64_t>> sizes;
  for (const auto& [index, tile] : tiles_in_order())
    sizes.emplace_back(index, tile->written + tile->buffer.size());
  return sizes;
}

}  // namespace understory
