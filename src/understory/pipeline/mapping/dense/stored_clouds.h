#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "understory/map/clouds/scan_clouds.h"
#include "understory/odometry/dense/dense_odometry.h"
#include "understory/pipeline/mapping/dense/dense_mapping_config.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/files/record_file.h"
#include "understory/util/timing.h"

namespace understory {

// The clouds of which the finished map is made. Far points change slowly with the place, so they
// may come from more scans than near ones (`map.far_cloud_distance_m`). Not thread-safe. Throws as
// ScanClouds does.
class StoredClouds {
 public:
  // `times` must outlive it. It holds nothing until `begin` or `load`.
  StoredClouds(const DenseMappingConfig& config, std::filesystem::path folder, StageTimes& times);

  // Empty files.
  void begin();
  // Keeps what a scan adds to the finished map, if it lies far enough from the scans before.
  // `keyframe`: the one that it belongs to, which may be the next to come.
  void offer(const DenseEstimate& estimate, std::size_t keyframe, const Pose& keyframe_from_body,
             const std::vector<Keyframe>& keyframes);

  [[nodiscard]] const KeyframeClouds& near() const { return near_->clouds(); }
  // Clouds of far points from the scans between; null where none are kept.
  [[nodiscard]] const KeyframeClouds* far() const { return far_ ? &far_->clouds() : nullptr; }

  void sync();
  void list(std::vector<CountedFile>& files) const;
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  ScanCloudsConfig near_config_;
  ScanCloudsConfig far_config_;
  bool with_far_ = false;
  std::filesystem::path folder_;
  StageTimes& times_;
  std::unique_ptr<ScanClouds> near_;
  std::unique_ptr<ScanClouds> far_;
};

}  // namespace understory
