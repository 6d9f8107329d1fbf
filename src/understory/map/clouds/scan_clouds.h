#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "understory/map/keyframes/keyframe_clouds.h"
#include "understory/map/keyframes/keyframe_map.h"
#include "understory/preprocess/body_cloud.h"
#include "understory/preprocess/voxel_filter.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/timing.h"

namespace understory {

// Which points of which scans enter the finished map.
struct ScanCloudsConfig {
  bool enabled = true;
  double distance_m = 1.0;  // weighted distance (37) between scans whose clouds are kept
  double thin_m = 0.02;     // one point per cube of this edge of each cloud; 0: all
  double range_min_m = 0.5;
  double range_max_m = 60.0;  // farther returns do not enter the finished map
  KeyframeConfig keyframe;    // weighs rotations against distances
};

// Chooses the scans whose clouds make the finished map, and keeps these on disk, thinned, each with
// the keyframe that takes it along. Wall time goes to the stage "store". Not thread-safe. Throws
// OutputError where the disk is full, InputError where the file is damaged.
class ScanClouds {
 public:
  // The scan whose cloud was kept last, here or elsewhere.
  struct Last {
    std::uint64_t keyframe = 0;
    Pose keyframe_from_body;
  };

  // Begins anew. `times` must outlive it.
  ScanClouds(const ScanCloudsConfig& config, const std::filesystem::path& path, StageTimes& times);
  // Goes on behind the clouds that are `known`.
  ScanClouds(const ScanCloudsConfig& config, const std::filesystem::path& path,
             const RecordCount& known, const std::optional<Last>& last, StageTimes& times);

  // Keeps the cloud if the scan lies far enough from the last one that was kept, by the poses that
  // keyframes have now. `keyframe`: the one it belongs to, which may be the next to come. True if
  // it is kept.
  bool offer(const BodyCloud& cloud, const Pose& world_from_body, std::size_t keyframe,
             const Pose& keyframe_from_body, const std::vector<Keyframe>& keyframes);

  // The scan there is kept elsewhere: the next ones are to lie far enough from it.
  void pass_over(std::size_t keyframe, const Pose& keyframe_from_body);

  [[nodiscard]] const KeyframeClouds& clouds() const { return clouds_; }
  [[nodiscard]] const std::optional<Last>& last() const { return last_; }
  void sync() { clouds_.sync(); }

 private:
  [[nodiscard]] std::vector<std::uint32_t> thinned(const BodyCloud& cloud);

  ScanCloudsConfig config_;
  StageTimes& times_;
  KeyframeClouds clouds_;
  VoxelFilter filter_;
  std::optional<Last> last_;
};

}  // namespace understory
