#include "understory/pipeline/mapping/dense/map_files.h"

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "understory/forest/inventory.h"
#include "understory/output/clouds/las_writer.h"
#include "understory/output/inventory_files.h"
#include "understory/output/layers/layer_files.h"
#include "understory/output/obstacle_files.h"
#include "understory/output/plot_files.h"

namespace understory {
namespace {

std::string title_of(const ReadRecording& recording) {
  return std::filesystem::path(recording.request.recording).filename().string();
}

struct CloudFile {
  LasOptions options;
  std::filesystem::path path;
};

// The trees that points belong to, of points that come tile by tile.
class PointOwners {
 public:
  explicit PointOwners(const InventoryResult& inventory) : inventory_(inventory) {}

  [[nodiscard]] std::uint32_t tree_at(const Eigen::Vector3d& point, double height_m) {
    const OwnerTiles* tiles = inventory_.owner_tiles.get();
    if (tiles == nullptr) return understory::tree_at(inventory_, point, height_m);
    if (!held_ || !tiles->holds(*held_, point)) hold_tile_of(*tiles, point);
    return held_ ? understory::tree_at(inventory_, owners_, point, height_m) : 0;
  }

 private:
  void hold_tile_of(const OwnerTiles& tiles, const Eigen::Vector3d& point) {
    held_.reset();
    owners_ = {};
    for (std::size_t tile = 0; tile < tiles.size() && !held_; ++tile) {
      if (tiles.holds(tile, point)) held_ = tile;
    }
    if (held_) owners_ = tiles.owners(*held_);
  }

  const InventoryResult& inventory_;
  std::optional<std::size_t> held_;
  TreeOwners owners_;
};

// `obstacles`: written beside the map where they are wanted; may be null.
std::uint64_t write_cloud(const CloudFile& to, MapTiles& tiles, const InventoryResult& inventory,
                          const ResultFrames& frames, MapPicture& picture, ObstacleFiles* obstacles,
                          const ProgressSink& progress) {
  LasWriter writer(to.path, to.options);
  PointOwners owners(inventory);
  double done = 0.0;
  tiles.for_each_block([&](MapTiles::TileIndex, std::span<const MapPoint> points) {
    for (const MapPoint& p : points) {
      const Eigen::Vector3d in_world(p.x, p.y, p.z);
      const double height = inventory.ground.height_above(in_world);
      const std::uint8_t las_class = inventory.ground.las_class(height);
      const Eigen::Vector3d at = frames.layers.from_world(in_world);
      LasRecord record;
      record.x = at.x();
      record.y = at.y();
      record.z = at.z();
      record.stamp = p.stamp;
      record.intensity = p.intensity;
      record.classification = las_class;
      record.tree_id = owners.tree_at(in_world, height);
      record.height_above_ground = static_cast<float>(height);
      writer.add(record);
      if (obstacles != nullptr) obstacles->add(in_world, height, record);
      const Eigen::Vector3d drawn = frames.local ? frames.local->from_world(in_world) : at;
      picture.add(drawn.x(), drawn.y(), drawn.z(), height);
    }
    done += static_cast<double>(points.size());
    progress({"writing map.laz", done / 1e3, 0.0, "thousand points", ""});
  });
  writer.commit(progress);
  return writer.points();
}

}  // namespace

std::uint64_t write_map(const ReadRecording& recording, const DenseMappingConfig& config,
                        DenseProducts& made, MapPicture& picture) {
  const Trajectory& trajectory = made.trajectory.trajectory;
  const ResultFrames& frames = made.placed.frames;
  const std::filesystem::path& folder = recording.results;
  const InventoryResult& inventory = made.inventory;
  std::optional<ObstacleFiles> obstacles;
  if (config.obstacles.enabled) {
    obstacles.emplace(folder, config.obstacles, trajectory, frames.layers,
                      inventory.owners.has_value() || inventory.owner_tiles != nullptr);
  }
  LasOptions options = las_options(frames.layers);
  options.trees = inventory.owners.has_value() || inventory.owner_tiles != nullptr;
  if (config.copc) ask_for_copc(options, recording.log);
  const std::uint64_t points =
      write_cloud({options, folder / "map.laz"}, *made.tiles, inventory, frames, picture,
                  obstacles ? &*obstacles : nullptr, recording.progress);
  if (obstacles) obstacles->commit(inventory.ground.terrain, frames.layers);
  write_tree_tables(folder, inventory);
  write_tree_layers(folder, inventory, trajectory, frames.layers, made.figures.table.plots);
  if (asks_for_plots(made.figures.table.config)) write_plot_tables(folder, made.figures.table);
  write_raster_layers(folder, inventory.ground.terrain, inventory.canopy,
                      change_into(frames.layers), frames.layers);
  write_layer_project(folder, title_of(recording), trajectory, frames.layers);
  return points;
}

}  // namespace understory
