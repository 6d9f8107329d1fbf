#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "understory/forest/tiles/tiled_cloud.h"
#include "understory/util/config/config.h"
#include "understory/util/files/scratch_file.h"

namespace understory {

// When an inventory holds a cloud in tiles on disk, and how large they are.
struct CloudTilesConfig {
  double size_m = 0.0;  // edge of a tile; 0: as large as the memory allows, if any is needed
  double max_memory_mb = 2000;  // that an inventory should take; MB of 10^6 bytes
};
void describe(ConfigTable& table, CloudTilesConfig& config);

// A point of a cloud in tiles: place relative to the cloud's origin, metres.
struct TilePoint {
  Eigen::Vector3f place = Eigen::Vector3f::Zero();
  float intensity = 0.0F;
  double gps_time = 0.0;
};

// A cloud sorted into square cells in a scratch file. A tile is the part of it that an inventory
// holds at a time: several cells. Points of a cell stay in the order in which they were added.
class CloudTiles : public TiledCloud {
 public:
  // `folder` exists. `extent_m`: of the cloud, about: the cells become larger for a large one.
  // Throws OutputError.
  CloudTiles(const std::filesystem::path& folder, const CloudTilesConfig& config, double extent_m);

  // First the origin (world frame), then the points, then `finish`.
  void set_origin(const Eigen::Vector3d& origin) { origin_ = origin; }
  void add(const TilePoint& point);
  // Chooses the tiles: `threads` of them are held at once. Throws ConfigError where not even the
  // smallest ones have room in the memory.
  void finish(int threads);

  [[nodiscard]] const std::vector<GroundArea>& tiles() const override { return tiles_; }
  [[nodiscard]] bool side_by_side() const override { return tiles_in_parallel_ > 1; }
  void all(const PointVisitor& visit) const override;
  void in(const GroundArea& area, const PointVisitor& visit) const override;
  [[nodiscard]] std::optional<double> level() const override { return level_; }
  [[nodiscard]] ScratchFile* scratch() const override { return &scratch_; }

  using RecordVisitor = std::function<void(std::span<const TilePoint>)>;
  // As `in`, with all that is known of the points.
  void records_in(const GroundArea& area, const RecordVisitor& visit) const;
  [[nodiscard]] Eigen::Vector3d world(const TilePoint& point) const {
    return origin_ + point.place.cast<double>();
  }

  [[nodiscard]] std::uint64_t points() const { return points_; }
  [[nodiscard]] float most_intensity() const { return most_intensity_; }
  [[nodiscard]] GroundArea extent() const;   // box of the cells that hold points
  [[nodiscard]] double thickness_m() const;  // from the lowest to the highest point
  [[nodiscard]] double tile_m() const { return tile_cells_ * cell_m_; }

 private:
  using CellIndex = std::pair<std::int32_t, std::int32_t>;  // row, column
  struct Cell {
    std::vector<TilePoint> buffer;
    std::vector<ScratchFile::Part> parts;
    std::uint64_t points = 0;
  };
  [[nodiscard]] CellIndex cell_of(const Eigen::Vector3d& point) const;
  [[nodiscard]] GroundArea area_of(const CellIndex& cell) const;
  void write_out(Cell& cell);
  void visit_cell(const Cell& cell, std::vector<TilePoint>& loaded,
                  const RecordVisitor& visit) const;
  void visit_places(const Cell& cell, std::vector<TilePoint>& loaded,
                    std::vector<Eigen::Vector3d>& places, const PointVisitor& visit) const;

  CloudTilesConfig config_;
  mutable ScratchFile scratch_;
  double cell_m_;
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  std::optional<double> level_;
  std::map<CellIndex, Cell> cells_;
  CellIndex last_index_{};
  Cell* last_ = nullptr;
  std::uint64_t buffered_ = 0;
  std::uint64_t points_ = 0;
  float most_intensity_ = 0.0F;
  float lowest_ = 0.0F;
  float highest_ = 0.0F;
  int tile_cells_ = 1;
  int tiles_in_parallel_ = 1;
  std::vector<GroundArea> tiles_;
};

}  // namespace understory
