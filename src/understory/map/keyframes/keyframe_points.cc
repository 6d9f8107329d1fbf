#include "understory/map/keyframes/keyframe_points.h"

#include <algorithm>
#include <utility>

namespace understory {

KeyframePoints::KeyframePoints(const std::filesystem::path& file, std::size_t cached)
    : clouds_(file), cached_(cached) {}

KeyframePoints::KeyframePoints(const std::filesystem::path& file, const RecordCount& known,
                               std::size_t cached)
    : clouds_(file, known), cached_(cached) {}

// The column of intensities, which these clouds do not have, says whether a cloud has features. A
// feature is its number and one, and 0 is none at all. The lidar stands in the column of times.
void KeyframePoints::append(TimeNs stamp, const FeaturePoints& cloud) {
  const std::lock_guard lock(mutex_);
  KeyframeCloud stored{static_cast<std::int32_t>(clouds_.size()), stamp, {}, {}};
  stored.points.reserve(cloud.points.size());
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    const Eigen::Vector3f& p = cloud.points[i];
    const int feature = cloud.features.empty() ? 0 : static_cast<int>(cloud.features[i]) + 1;
    const std::uint16_t lidar = cloud.lidars.empty() ? 0 : cloud.lidars[i];
    stored.points.push_back({p.x(), p.y(), p.z(), static_cast<std::uint16_t>(feature), lidar});
  }
  remember(clouds_.size(), std::make_shared<const FeaturePoints>(cloud));
  clouds_.append(stored);
}

std::shared_ptr<const FeaturePoints> KeyframePoints::get(std::size_t keyframe) {
  const std::lock_guard lock(mutex_);
  const auto found = cache_.find(keyframe);
  if (found != cache_.end()) {
    found->second.used = ++uses_;
    return found->second.cloud;
  }
  const KeyframeCloud stored = clouds_.read(keyframe);
  FeaturePoints cloud;
  cloud.points.reserve(stored.points.size());
  bool further = false;
  for (const KeyframePoint& p : stored.points) {
    cloud.points.emplace_back(p.x, p.y, p.z);
    if (p.intensity > 0) cloud.features.push_back(static_cast<PointFeature>(p.intensity - 1));
    further = further || p.t_10us > 0;
  }
  if (further) {
    cloud.lidars.reserve(stored.points.size());
    for (const KeyframePoint& p : stored.points)
      cloud.lidars.push_back(static_cast<std::uint8_t>(p.t_10us));
  }
  auto shared = std::make_shared<const FeaturePoints>(std::move(cloud));
  remember(keyframe, shared);
  return shared;
}

void KeyframePoints::remember(std::size_t keyframe, std::shared_ptr<const FeaturePoints> cloud) {
  cache_[keyframe] = {std::move(cloud), ++uses_};
  if (cache_.size() <= cached_) return;
  const auto oldest =
      std::min_element(cache_.begin(), cache_.end(),
                       [](const auto& a, const auto& b) { return a.second.used < b.second.used; });
  cache_.erase(oldest);
}

void KeyframePoints::forget() {
  const std::lock_guard lock(mutex_);
  cache_.clear();
}

void KeyframePoints::sync() {
  const std::lock_guard lock(mutex_);
  clouds_.sync();
}

RecordCount KeyframePoints::count() const {
  const std::lock_guard lock(mutex_);
  return clouds_.count();
}

}  // namespace understory
