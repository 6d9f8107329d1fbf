#include "understory/map/keyframe_points.h"

#include <algorithm>

namespace understory {

KeyframePoints::KeyframePoints(const std::filesystem::path& file, std::size_t cached)
    : clouds_(file), cached_(cached) {}

KeyframePoints::KeyframePoints(const std::filesystem::path& file, const RecordCount& known,
                               std::size_t cached)
    : clouds_(file, known), cached_(cached) {}

void KeyframePoints::append(TimeNs stamp, const Points& points) {
  const std::lock_guard lock(mutex_);
  KeyframeCloud cloud{static_cast<std::int32_t>(clouds_.size()), stamp, {}, {}};
  cloud.points.reserve(points.size());
  for (const Eigen::Vector3f& p : points)
    cloud.points.push_back({p.x(), p.y(), p.z(), 0, 0});
  remember(clouds_.size(), std::make_shared<const Points>(points));
  clouds_.append(cloud);
}

std::shared_ptr<const Points> KeyframePoints::get(std::size_t keyframe) {
  const std::lock_guard lock(mutex_);
  const auto found = cache_.find(keyframe);
  if (found != cache_.end()) {
    found->second.used = ++uses_;
    return found->second.points;
  }
  const KeyframeCloud cloud = clouds_.read(keyframe);
  Points points;
  points.reserve(cloud.points.size());
  for (const KeyframePoint& p : cloud.points)
    points.emplace_back(p.x, p.y, p.z);
  auto shared = std::make_shared<const Points>(std::move(points));
  remember(keyframe, shared);
  return shared;
}

void KeyframePoints::remember(std::size_t keyframe, std::shared_ptr<const Points> points) {
  cache_[keyframe] = {std::move(points), ++uses_};
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
