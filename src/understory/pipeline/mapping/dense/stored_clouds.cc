#include "understory/pipeline/mapping/dense/stored_clouds.h"

#include <algorithm>

#include "understory/geometry/pose_io.h"

namespace understory {
namespace {

constexpr const char* kNearFile = "clouds.bin";
constexpr const char* kFarFile = "far_clouds.bin";

ScanCloudsConfig near_clouds(const DenseMappingConfig& config) {
  ScanCloudsConfig clouds;
  clouds.enabled = config.map_enabled;
  clouds.distance_m = config.cloud_distance_m;
  clouds.thin_m = config.keyframe_thin_m;
  clouds.range_min_m = config.odometry.voxel.range_min_m;
  clouds.range_max_m = config.map_range_max_m;
  clouds.keyframe = config.keyframe_map.keyframe;
  return clouds;
}

// Far points lie farther from each other than a cloud is thinned.
ScanCloudsConfig far_clouds(const DenseMappingConfig& config) {
  ScanCloudsConfig clouds = near_clouds(config);
  clouds.distance_m = config.far_cloud_distance_m;
  clouds.range_min_m = std::max(clouds.range_min_m, config.far_m);
  clouds.thin_m = 0.0;
  return clouds;
}

void put_last(BinaryWriter& writer, const ScanClouds::Last& last) {
  writer.put(last.keyframe);
  put_pose(writer, last.keyframe_from_body);
}

ScanClouds::Last get_last(BinaryReader& reader) {
  ScanClouds::Last last;
  last.keyframe = reader.get<std::uint64_t>();
  last.keyframe_from_body = get_pose(reader);
  return last;
}

}  // namespace

StoredClouds::StoredClouds(const DenseMappingConfig& config, std::filesystem::path folder,
                           StageTimes& times)
    : near_config_(near_clouds(config)),
      far_config_(far_clouds(config)),
      with_far_(config.map_enabled && config.far_cloud_distance_m > 0.0 &&
                config.far_cloud_distance_m < config.cloud_distance_m),
      folder_(std::move(folder)),
      times_(times) {}

void StoredClouds::begin() {
  near_ = std::make_unique<ScanClouds>(near_config_, folder_ / kNearFile, times_);
  if (with_far_) far_ = std::make_unique<ScanClouds>(far_config_, folder_ / kFarFile, times_);
}

void StoredClouds::offer(const DenseEstimate& estimate, std::size_t keyframe,
                         const Pose& keyframe_from_body, const std::vector<Keyframe>& keyframes) {
  const auto offer_to = [&](ScanClouds& clouds) {
    return clouds.offer(estimate.cloud, estimate.state.world_from_body, keyframe,
                        keyframe_from_body, keyframes);
  };
  const bool kept = offer_to(*near_);
  if (!far_) return;
  if (kept)
    far_->pass_over(keyframe, keyframe_from_body);
  else
    offer_to(*far_);
}

void StoredClouds::sync() {
  near_->sync();
  if (far_) far_->sync();
}

void StoredClouds::list(std::vector<CountedFile>& files) const {
  files.push_back({kNearFile, near_->clouds().count()});
  if (far_) files.push_back({kFarFile, far_->clouds().count()});
}

void StoredClouds::save(BinaryWriter& writer) const {
  for (const ScanClouds* clouds : {near_.get(), far_.get()}) {
    if (clouds == nullptr) continue;
    put_optional(writer, clouds->last(), put_last);
    writer.put(clouds->clouds().count());
  }
}

void StoredClouds::load(BinaryReader& reader) {
  const auto load_clouds = [&](const ScanCloudsConfig& config, const char* file) {
    const auto last = get_optional(reader, get_last);
    const auto known = reader.get<RecordCount>();
    return std::make_unique<ScanClouds>(config, folder_ / file, known, last, times_);
  };
  near_ = load_clouds(near_config_, kNearFile);
  if (with_far_) far_ = load_clouds(far_config_, kFarFile);
}

}  // namespace understory
