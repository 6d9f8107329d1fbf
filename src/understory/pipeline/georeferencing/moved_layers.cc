#include "understory/pipeline/georeferencing/moved_layers.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "understory/georeference/terrain_file.h"
#include "understory/output/copc/copc_writer.h"
#include "understory/output/layers/layer_files.h"
#include "understory/output/obstacle_files.h"
#include "understory/recording/bags/byte_source.h"
#include "understory/recording/clouds/las.h"

namespace understory {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kAnywhere = 1e8;

// All of a raster of the run; empty where there is none.
Raster read_layer(const fs::path& file) {
  if (!fs::exists(file)) return {};
  const PlaneArea all{Vector2d::Constant(-kAnywhere), Vector2d::Constant(kAnywhere)};
  return read_terrain(file, all, std::nullopt);
}

// The way of one point through both worlds.
struct Move {
  const LayerFrame& from;
  const Pose& target_from_world;
  const LayerFrame& to;
  const ProgressSink& progress;
  Pose world_from_target = target_from_world.inverse();

  [[nodiscard]] Vector3d to_target_world(const Vector3d& point_in_layer) const {
    return target_from_world * from.to_world(point_in_layer);
  }
  [[nodiscard]] FrameChange change() const {
    return {[this](const Vector3d& point) { return to.from_world(to_target_world(point)); },
            [this](const Vector3d& point) {
              return from.from_world(world_from_target * to.to_world(point));
            },
            to.units_per_metre() / from.units_per_metre(), false};
  }
};

// The picture that a cloud is drawn into, and its frame; null: none.
struct Drawing {
  const LayerFrame& frame;
  MapPicture* picture;
};

void move_cloud(const fs::path& from, const fs::path& to, const Move& move, const Raster& ground,
                const Drawing& drawing, Log& log) {
  const auto file = open_file(from.string());
  const LasHeader header = read_las_header(*file);
  LasOptions options = las_options(move.to);
  if (fs::exists(copc_path(from))) ask_for_copc(options, log);
  options.gps_week_time = header.gps_week_time;
  options.trees = header.has_trees;
  LasWriter writer(to, options);
  read_las_points(*file, header, log, [&](const LasPoint& point) {
    move.progress.poll();
    LasRecord record;
    const Vector3d in_world = move.to_target_world(point.position);
    const Vector3d at = move.to.from_world(in_world);
    record.x = at.x();
    record.y = at.y();
    record.z = at.z();
    record.gps_time = point.gps_time;
    record.intensity =
        static_cast<std::uint16_t>(std::clamp(std::lround(point.intensity), 0L, 65535L));
    record.classification = point.classification;
    record.tree_id = point.tree_id;
    record.height_above_ground = point.height_above_ground;
    writer.add(record);
    if (drawing.picture == nullptr) return;
    const Vector3d drawn = drawing.frame.from_world(in_world);
    const double height =
        ground.empty()
            ? std::numeric_limits<double>::quiet_NaN()
            : point.position.z() - ground.interpolate(point.position.x(), point.position.y());
    drawing.picture->add(drawn.x(), drawn.y(), drawn.z(), height);
  });
  writer.commit(move.progress);
}

}  // namespace

void write_moved_layers(const RunLayers& from, const Pose& target_from_world, const RunLayers& to,
                        const LayerFrame& drawing, MapPicture& picture, Log& log) {
  const Move move{from.frame, target_from_world, to.frame, from.progress};
  const Raster ground = read_layer(from.folder / "dtm.tif");
  const auto move_one = [&](const char* name, MapPicture* drawn) {
    if (fs::exists(from.folder / name))
      move_cloud(from.folder / name, to.folder / name, move, ground, {drawing, drawn}, log);
  };
  move_one("map.laz", &picture);
  move_one("obstacles.laz", nullptr);
  if (ground.empty()) return;
  write_raster_layers(to.folder, ground, read_layer(from.folder / "chm.tif"), move.change(),
                      to.frame);
  write_free_height(to.folder, read_layer(from.folder / "free_height.tif"), ground, move.change(),
                    to.frame);
}

}  // namespace understory
