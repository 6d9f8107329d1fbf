#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "understory/forest/obstacles.h"
#include "understory/geometry/raster.h"
#include "understory/geometry/stamped_pose.h"
#include "understory/georeference/systems/layer_frame.h"
#include "understory/georeference/systems/moved_raster.h"
#include "understory/output/clouds/las_writer.h"

namespace understory {

// obstacles.laz and free_height.tif of a map, in the frame of the layers. Points are handed over as
// map.laz gets them. The files appear with `commit`. Throws OutputError. Not thread-safe.
class ObstacleFiles {
 public:
  // `path` is in the world frame. `trees`: with the columns tree_id and HeightAboveGround.
  ObstacleFiles(const std::filesystem::path& folder, const ObstacleConfig& config,
                const std::vector<StampedPose>& path, const LayerFrame& layers, bool trees);

  // A point in the world frame, its height above the ground, and the same as map.laz gets it.
  void add(const Eigen::Vector3d& in_world, double height_m, const LasRecord& record);
  // `terrain`: the ground, world frame.
  void commit(const Raster& terrain, const LayerFrame& layers);

 private:
  std::filesystem::path folder_;
  ObstacleMap map_;
  LasWriter writer_;
};

// Writes free_height.tif: heights above the ground over cells of the layers' grid. `change` leads
// there from the frame of the raster. Nothing where it is empty. Throws OutputError.
void write_free_height(const std::filesystem::path& folder, const Raster& free_height,
                       const Raster& terrain, const FrameChange& change, const LayerFrame& layers);

}  // namespace understory
