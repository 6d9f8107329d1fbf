#include "understory/output/obstacle_files.h"

#include "understory/output/layers/geo_files.h"
#include "understory/output/layers/layer_files.h"

namespace understory {
namespace {

LasOptions options_of(const LayerFrame& layers, bool trees) {
  LasOptions options = las_options(layers);
  options.trees = trees;
  return options;
}

std::vector<Eigen::Vector3d> places_of(const std::vector<StampedPose>& path) {
  std::vector<Eigen::Vector3d> places;
  for (const StampedPose& pose : path)
    places.push_back(pose.world_from_body.translation());
  return places;
}

}  // namespace

ObstacleFiles::ObstacleFiles(const std::filesystem::path& folder, const ObstacleConfig& config,
                             const std::vector<StampedPose>& path, const LayerFrame& layers,
                             bool trees)
    : folder_(folder),
      map_(config, places_of(path)),
      writer_(folder / "obstacles.laz", options_of(layers, trees)) {}

void ObstacleFiles::add(const Eigen::Vector3d& in_world, double height_m, const LasRecord& record) {
  if (map_.add(in_world, height_m)) writer_.add(record);
}

void ObstacleFiles::commit(const Raster& terrain, const LayerFrame& layers) {
  writer_.commit();
  write_free_height(folder_, map_.free_height(), terrain, change_into(layers), layers);
}

void write_free_height(const std::filesystem::path& folder, const Raster& free_height,
                       const Raster& terrain, const FrameChange& change, const LayerFrame& layers) {
  if (free_height.empty() || terrain.empty()) return;
  const Raster moved = moved_raster(free_height, terrain, change, CellHeights::kAboveGround);
  write_geotiff(folder / "free_height.tif", moved, layers.wkt(),
                "free height above the ground, below the lowest obstacle");
}

}  // namespace understory
