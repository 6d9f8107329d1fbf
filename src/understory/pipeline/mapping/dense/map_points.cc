#include "understory/pipeline/mapping/dense/map_points.h"

#include <algorithm>
#include <utility>

namespace understory {
namespace {

FeaturePoints points_in_range(const BodyCloud& cloud, const VoxelFilterConfig& config) {
  const auto low = static_cast<float>(config.range_min_m);
  const auto high = static_cast<float>(config.range_max_m);
  FeaturePoints kept;
  const std::vector<std::uint8_t> lidars = lidars_of(cloud.ring);
  kept.points.reserve(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (!(cloud.range[i] >= low && cloud.range[i] <= high)) continue;
    kept.points.push_back(cloud.points[i]);
    if (!cloud.feature.empty()) kept.features.push_back(cloud.feature[i]);
    if (!lidars.empty()) kept.lidars.push_back(lidars[i]);
  }
  return kept;
}

FeaturePoints with_lidars(BodyCloud&& cloud) {
  return {std::move(cloud.points), std::move(cloud.feature), lidars_of(cloud.ring)};
}

// One point a voxel of what goes along, lidar by lidar.
void add_carried(const BodyCloud& cloud, const VoxelFilterConfig& config, VoxelFilter& filter,
                 FeaturePoints& to) {
  std::vector<Points> carried(1);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (!cloud.is_carried(i) || static_cast<double>(cloud.range[i]) < config.range_min_m) continue;
    const std::size_t lidar = cloud.ring[i] / kRingsALidar;
    if (lidar >= carried.size()) carried.resize(lidar + 1);
    carried[lidar].push_back(cloud.points[i]);
  }
  if (carried.size() > 1) to.lidars.resize(to.points.size(), 0);
  for (std::size_t lidar = 0; lidar < carried.size(); ++lidar) {
    const Points thinned = filter.filter(carried[lidar], config.voxel_size_m);
    to.points.insert(to.points.end(), thinned.begin(), thinned.end());
    if (carried.size() > 1 || !to.lidars.empty())
      to.lidars.resize(to.points.size(), static_cast<std::uint8_t>(lidar));
  }
}

}  // namespace

MapPoints::MapPoints(const DenseMappingConfig& config)
    : matched_(config.odometry.voxel), mapped_(config.odometry.voxel) {
  mapped_.voxel_size_m = std::min(matched_.voxel_size_m, config.keyframe_map.keyframe.voxel_size_m);
}

FeaturePoints MapPoints::of(const DenseEstimate& estimate) {
  const BodyCloud& cloud = estimate.tops ? *estimate.tops : estimate.cloud;
  if (mapped_.voxel_size_m == 0.0) return points_in_range(cloud, mapped_);
  if (!estimate.cloud.feature.empty())
    return with_lidars(filter_.filter_features(estimate.cloud, mapped_, true));
  if (mapped_.voxel_size_m == matched_.voxel_size_m) {
    // What seems to be carried may be a stem beside a machine that stands: it is seen again later.
    FeaturePoints points = with_lidars(BodyCloud(estimate.thinned));
    add_carried(cloud, mapped_, filter_, points);
    return points;
  }
  return with_lidars(filter_.filter(cloud, mapped_, true));
}

}  // namespace understory
