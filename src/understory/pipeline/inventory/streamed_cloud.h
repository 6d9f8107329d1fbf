#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "understory/pipeline/inventory/cloud_tiles.h"
#include "understory/recording/clouds/cloud_file.h"
#include "understory/util/log.h"
#include "understory/util/progress.h"

namespace understory {

// A change of the frame of a cloud. Points are relative to the cloud's origin before and after.
struct CloudMove {
  std::function<Eigen::Vector3d(const Eigen::Vector3d& origin)> origin;
  std::function<Eigen::Vector3f(const Eigen::Vector3d& origin, const Eigen::Vector3f& point)> point;
};

// How an inventory may put a cloud on disk.
struct CloudTiling {
  CloudTilesConfig config;
  std::filesystem::path folder;  // for temporary files
  int threads = 1;
  bool copc = false;  // its points are written as map.copc.laz, too
};

// A cloud that lies on disk in tiles.
struct StreamedCloud {
  PointCloudFile about;  // all but its points
  std::shared_ptr<CloudTiles> tiles;
  std::vector<Eigen::Vector3d> sample;  // every `sample_step`-th point, about the first
  std::size_t sample_step = 1;
  bool has_times = false;
  bool has_intensity = false;
};

// Reads a cloud once and sorts it into tiles. Gives nothing where it fits into the memory, or its
// format is read as a whole (PLY, PCD). First `change` is made, if there is one, then the moves one
// after the other. Throws InputError as read_cloud does, OutputError where the disk has no room,
// ConfigError where tiles have no room in the memory. Polls `progress`.
[[nodiscard]] std::optional<StreamedCloud> stream_cloud(const std::string& path,
                                                        const CloudTiling& tiling,
                                                        const PlaceChange& change,
                                                        const std::vector<CloudMove>& moves,
                                                        Log& log, const ProgressSink& progress);

}  // namespace understory
