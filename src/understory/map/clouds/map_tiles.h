#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "understory/util/time.h"

namespace understory {

// A point of the finished map, world frame, metres. Coordinates are relative to the tile's corner
// in single precision and exact to 1e-6 m there.
struct MapPoint {
  double x = 0.0;
  double y = 0.0;
  double z = 0.0;
  TimeNs stamp = 0;
  std::uint16_t intensity = 0;
  bool of_neighbour = false;  // lies in another tile, within `border_m` of this one
};

// Places of a finished map lie on a grid of 2^-9 m (2 mm) in the world frame. map.laz may round
// them to a millimetre in any other frame: its reader finds the same places again, and so the same
// trees. Single precision holds them exactly up to 32 km from a place of the grid.
[[nodiscard]] double on_map_grid(double metres);
[[nodiscard]] Eigen::Vector3d on_map_grid(const Eigen::Vector3d& place);

// Sorts the points of a map of any size into square tiles, on disk where they are many. It hands
// the tiles back one by one, thinned: at most one point (the first that was measured) in each cube
// of `thin_m`. Memory is that of the write buffers and of the index that thins one tile.
class MapTiles {
 public:
  struct Config {
    double tile_m = 20.0;
    double thin_m = 0.02;  // 0 = keep every point
    double border_m =
        0.0;               // a tile also gets its neighbours' points that are so near; below tile_m
    bool on_grid = false;  // points are handed back at the nearest place of on_map_grid()
    // Bytes for the write buffers, and for the index that thins; all points lie on disk then. 0:
    // usual buffers, any index.
    double most_bytes = 0.0;
  };
  using TileIndex = std::pair<std::int32_t, std::int32_t>;  // x, y in tiles

  // `folder` is made, and removed again by the destructor.
  MapTiles(std::filesystem::path folder, const Config& config);
  ~MapTiles();
  MapTiles(const MapTiles&) = delete;
  MapTiles& operator=(const MapTiles&) = delete;

  void add(const MapPoint& point);
  // Calls `visit` with each non-empty tile's points, tiles in order of y then x. May be called
  // again, but after the first call no point may be added.
  void for_each(const std::function<void(TileIndex, const std::vector<MapPoint>&)>& visit);
  // The same in blocks of some ten thousand points, so that no tile is held as a whole.
  void for_each_block(const std::function<void(TileIndex, std::span<const MapPoint>)>& visit);
  // Calls `visit` with the places of all points (world frame, metres), in the order of for_each, a
  // few ten thousand at a time. May be called again, like for_each.
  void for_each_place(const std::function<void(std::span<const Eigen::Vector3d>)>& visit);
  // The places of one tile, in the same way; nothing where there is no such tile.
  void for_each_place_in(TileIndex index,
                         const std::function<void(std::span<const Eigen::Vector3d>)>& visit);
  // The tiles and how many points each has, thinned, in order of y then x.
  [[nodiscard]] std::vector<std::pair<TileIndex, std::uint64_t>> sizes();
  [[nodiscard]] double tile_m() const { return config_.tile_m; }
  [[nodiscard]] std::uint64_t points_added() const { return points_added_; }

 private:
  struct Record;
  struct Tile;
  void add_to(TileIndex index, const MapPoint& point, bool of_neighbour);
  void write_out(TileIndex index, Tile& tile);
  void thin_all();
  void thin(TileIndex index, Tile& tile);
  [[nodiscard]] std::uint64_t buffered_at_most() const;
  [[nodiscard]] std::filesystem::path file_of(TileIndex index) const;
  using RecordVisitor = std::function<void(std::span<const Record>)>;
  void for_each_record(TileIndex index, const Tile& tile, const RecordVisitor& visit) const;
  void for_each_place_of(TileIndex index, const Tile& tile,
                         const std::function<void(std::span<const Eigen::Vector3d>)>& visit) const;
  [[nodiscard]] std::vector<bool> kept_of(TileIndex index, const Tile& tile) const;
  [[nodiscard]] double corner(std::int32_t tiles) const;
  // A record as it is handed back.
  [[nodiscard]] Record stored(TileIndex index, Record record) const;
  [[nodiscard]] std::vector<std::pair<TileIndex, const Tile*>> tiles_in_order() const;

  std::filesystem::path folder_;
  Config config_;
  std::map<TileIndex, Tile> tiles_;
  std::uint64_t points_added_ = 0;
  std::uint64_t buffered_ = 0;
  bool thinned_ = false;
};

}  // namespace understory
