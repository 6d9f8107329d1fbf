#include "understory/pipeline/mapping/dense/map_files.h"

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "understory/forest/inventory.h"
#include "understory/output/inventory_files.h"
#include "understory/output/las_writer.h"
#include "understory/output/layer_files.h"
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

// `obstacles`: written beside the map where they are wanted; may be null.
std::uint64_t write_cloud(const CloudFile& to, MapTiles& tiles, const InventoryResult& inventory,
                          const ResultFrames& frames, MapPicture& picture, ObstacleFiles* obstacles,
                          const ProgressSink& progress) {
  LasWriter writer(to.path, to.options);
  double done = 0.0;
  tiles.for_each([&](MapTiles::TileIndex, const std::vector<MapPoint>& points) {
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
      record.tree_id = tree_at(inventory, in_world, height);
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
                      inventory.owners.has_value());
  }
  LasOptions options = las_options(frames.layers);
  options.trees = inventory.owners.has_value();
  if (config.copc) ask_for_copc(options, recording.log);
  const std::uint64_t points =
      write_cloud({options, folder / "map.laz"}, *made.tiles, inventory, frames, picture,
                  obstacles ? &*obstacles : nullptr, recording.progress);
  if (obstacles) obstacles->commit(inventory.ground.terrain, frames.layers);
  write_tree_tables(folder, inventory);
  write_tree_layers(folder, inventory.trees, trajectory, frames.layers, inventory.look_again,
                    made.figures.table.plots);
  if (asks_for_plots(made.figures.table.config)) write_plot_tables(folder, made.figures.table);
  write_raster_layers(folder, inventory.ground.terrain, inventory.canopy,
                      change_into(frames.layers), frames.layers);
  write_layer_project(folder, title_of(recording), trajectory, frames.layers);
  return points;
}

}  // namespace understory
