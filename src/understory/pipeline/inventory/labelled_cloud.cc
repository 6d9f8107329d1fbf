#include "understory/pipeline/inventory/labelled_cloud.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "understory/output/clouds/las_writer.h"
#include "understory/pipeline/pipeline_constants.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using namespace pipeline_constants::labelled_cloud;

// What the intensities of a cloud are multiplied by: some formats have them from 0 to 1.
float intensity_scale(const StandCloud& stand) {
  float most = stand.streamed ? stand.streamed->tiles->most_intensity() : 0.0F;
  for (const float intensity : stand.cloud.intensity)
    if (intensity > most) most = intensity;
  const bool las = stand.cloud.format.rfind("LA", 0) == 0;
  return !las && most <= 1.0F ? 65535.0F : 1.0F;
}

std::uint16_t las_intensity(float intensity) {
  return intensity > 0.0F ? static_cast<std::uint16_t>(std::lround(std::min(intensity, 65535.0F)))
                          : std::uint16_t{0};
}

// map.laz: the cloud with classes, the tree of each point and heights above the ground.
class Labeller {
 public:
  Labeller(const LabelledStand& from, const LasOptions& options, const std::filesystem::path& file)
      : from_(from),
        options_(options),
        scale_(intensity_scale(from.stand)),
        writer_(file, options) {}

  void write_whole(const ProgressSink& progress) {
    const PointCloudFile& cloud = from_.stand.cloud;
    std::vector<TilePoint> points;
    for (std::size_t i = 0; i < cloud.points.size(); ++i) {
      progress.poll();
      points.push_back({cloud.points[i], cloud.intensity.empty() ? 0.0F : cloud.intensity[i],
                        cloud.gps_time.empty() ? 0.0 : cloud.gps_time[i]});
      if (points.size() < kAtOnce && i + 1 < cloud.points.size()) continue;
      write(points, cloud.origin, !cloud.gps_time.empty(), *from_.inventory.owners);
      points.clear();
    }
  }

  // A point belongs to the tile that holds its cube.
  void write_tiles(const ProgressSink& progress) {
    const StreamedCloud& streamed = *from_.stand.streamed;
    const std::vector<GroundArea>& tiles = streamed.tiles->tiles();
    for (std::size_t tile = 0; tile < tiles.size(); ++tile) {
      const OwnerTiles* owner_tiles = from_.inventory.owner_tiles.get();
      const TreeOwners of_tile = owner_tiles != nullptr ? owner_tiles->owners(tile) : TreeOwners();
      const TreeOwners& owners = owner_tiles != nullptr ? of_tile : *from_.inventory.owners;
      std::vector<TilePoint> here;
      streamed.tiles->records_in(
          tiles[tile].grown(kBesideTile), [&](std::span<const TilePoint> points) {
            progress.poll();
            here.clear();
            for (const TilePoint& point : points) {
              if (owner_tiles == nullptr || owner_tiles->holds(tile, streamed.tiles->world(point)))
                here.push_back(point);
            }
            write(here, from_.stand.cloud.origin, streamed.has_times, owners);
          });
    }
  }

  // Returns how many points lie too far from the others.
  std::uint64_t commit(const ProgressSink& progress) {
    writer_.commit(progress);
    return too_far_;
  }

 private:
  static constexpr std::size_t kAtOnce = 65'536;

  void write(const std::vector<TilePoint>& points, const Eigen::Vector3d& origin, bool times,
             const TreeOwners& owners) {
    records_.resize(points.size());
    parallel_for(points.size(), 4096,
                 [&](std::size_t i) { records_[i] = record_of(points[i], origin, times, owners); });
    // By one thread: a frame on the globe keeps what it looked up last.
    for (LasRecord& record : records_) {
      const Eigen::Vector3d in_world(record.x, record.y, record.z);
      const Eigen::Vector3d at =
          from_.layers != nullptr ? from_.layers->from_world(in_world) : in_world;
      record.x = at.x();
      record.y = at.y();
      record.z = at.z();
      if (has_room(options_, {record.x, record.y, record.z})) {
        writer_.add(record);
      } else {
        ++too_far_;
      }
    }
  }

  // With its place in the world frame. Thread-safe.
  [[nodiscard]] LasRecord record_of(const TilePoint& point, const Eigen::Vector3d& origin,
                                    bool times, const TreeOwners& owners) const {
    const InventoryResult& inventory = from_.inventory;
    const Eigen::Vector3d in_world = origin + point.place.cast<double>();
    const double height = inventory.ground.height_above(in_world);
    LasRecord record;
    record.x = in_world.x();
    record.y = in_world.y();
    record.z = in_world.z();
    if (times) record.gps_time = point.gps_time;
    record.intensity = las_intensity(scale_ * point.intensity);
    record.classification = inventory.ground.las_class(height);
    record.tree_id = tree_at(inventory, owners, in_world, height);
    record.height_above_ground = static_cast<float>(height);
    return record;
  }

  LabelledStand from_;
  LasOptions options_;
  float scale_;
  LasWriter writer_;
  std::vector<LasRecord> records_;
  std::uint64_t too_far_ = 0;
};

}  // namespace

std::uint64_t write_labelled_cloud(const LabelledStand& from, const LasOptions& options,
                                   const std::filesystem::path& file,
                                   const ProgressSink& progress) {
  Labeller cloud(from, options, file);
  if (from.stand.streamed) {
    cloud.write_tiles(progress);
  } else {
    cloud.write_whole(progress);
  }
  return cloud.commit(progress);
}

}  // namespace understory
