#include "understory/map/clouds/scan_clouds.h"

#include <algorithm>
#include <numeric>

namespace understory {
namespace {

std::uint16_t clamp_to_u16(double value) {
  return static_cast<std::uint16_t>(std::clamp(value, 0.0, 65'535.0));
}

}  // namespace

ScanClouds::ScanClouds(const ScanCloudsConfig& config, const std::filesystem::path& path,
                       StageTimes& times)
    : config_(config), times_(times), clouds_(path) {}

ScanClouds::ScanClouds(const ScanCloudsConfig& config, const std::filesystem::path& path,
                       const RecordCount& known, const std::optional<Last>& last, StageTimes& times)
    : config_(config), times_(times), clouds_(path, known), last_(last) {}

bool ScanClouds::offer(const BodyCloud& cloud, const Pose& world_from_body, std::size_t keyframe,
                       const Pose& keyframe_from_body, const std::vector<Keyframe>& keyframes) {
  if (!config_.enabled) return false;
  if (last_) {
    const Pose world_from_last =
        keyframes[last_->keyframe].world_from_body * last_->keyframe_from_body;
    if (keyframe_distance(world_from_last, world_from_body, config_.keyframe) < config_.distance_m)
      return false;
  }
  const ScopedTimer timer(times_, "store");
  pass_over(keyframe, keyframe_from_body);
  KeyframeCloud stored{static_cast<std::int32_t>(keyframe), cloud.stamp, {}, keyframe_from_body};
  const std::vector<std::uint32_t> kept = thinned(cloud);
  const auto nearest = static_cast<float>(config_.range_min_m);
  const auto farthest = static_cast<float>(config_.range_max_m);
  stored.points.reserve(kept.size());
  for (const std::uint32_t i : kept) {
    if (cloud.range[i] < nearest || cloud.range[i] > farthest) continue;
    const Eigen::Vector3f& p = cloud.points[i];
    stored.points.push_back({p.x(), p.y(), p.z(), clamp_to_u16(cloud.intensity[i]),
                             clamp_to_u16(static_cast<double>(cloud.t_ns[i]) * 1e-4)});
  }
  clouds_.append(stored);
  return true;
}

void ScanClouds::pass_over(std::size_t keyframe, const Pose& keyframe_from_body) {
  last_ = Last{keyframe, keyframe_from_body};
}

std::vector<std::uint32_t> ScanClouds::thinned(const BodyCloud& cloud) {
  if (config_.thin_m > 0.0) return filter_.keep(cloud.points, config_.thin_m);
  std::vector<std::uint32_t> all(cloud.size());
  std::iota(all.begin(), all.end(), 0U);
  return all;
}

}  // namespace understory
