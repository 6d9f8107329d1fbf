#pragma once

#include "understory/odometry/dense/dense_odometry.h"
#include "understory/pipeline/mapping/dense/dense_mapping_config.h"
#include "understory/preprocess/voxel_filter.h"

namespace understory {

// What the local map takes from the scan of a keyframe: more points than those that are matched.
// Not thread-safe.
class MapPoints {
 public:
  explicit MapPoints(const DenseMappingConfig& config);
  // In the body frame, metres. Of an estimate by tree tops the tops alone.
  [[nodiscard]] FeaturePoints of(const DenseEstimate& estimate);

 private:
  VoxelFilterConfig matched_;
  VoxelFilterConfig mapped_;  // with edge 0: every point within range
  VoxelFilter filter_;
};

}  // namespace understory
