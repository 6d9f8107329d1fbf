#include "understory/geometry/path_pose.h"

#include <algorithm>

namespace understory {

Pose pose_on_path(std::span<const StampedPose> path, TimeNs time, double beyond) {
  auto after = std::lower_bound(path.begin(), path.end(), time,
                                [](const StampedPose& pose, TimeNs t) { return pose.stamp < t; });
  if (after == path.begin()) return path.front().world_from_body;
  if (after == path.end()) {
    if (path.size() < 2 || beyond <= 0.0) return path.back().world_from_body;
    --after;
  }
  const StampedPose& before = *(after - 1);
  const double share = to_seconds(time - before.stamp) / to_seconds(after->stamp - before.stamp);
  return interpolate(before.world_from_body, after->world_from_body, std::min(share, 1.0 + beyond));
}

}  // namespace understory
