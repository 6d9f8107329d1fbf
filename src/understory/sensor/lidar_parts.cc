#include "understory/sensor/lidar_parts.h"

namespace understory {

std::vector<LidarPart> lidar_parts(const Scan& merged, const Rig& rig) {
  std::vector<LidarPart> parts(1);
  parts.front().body_from_lidar = rig.body_from_lidar;
  std::vector<Pose> own_from_first(1);
  for (const FurtherLidar& further : rig.further_lidars) {
    if (further.first_ring == 0) break;
    parts.emplace_back().body_from_lidar = rig.body_from_lidar * further.lidar_from_further;
    own_from_first.push_back(further.lidar_from_further.inverse());
  }
  for (LidarPart& part : parts) {
    part.scan.stamp = merged.stamp;
    part.scan.has_point_times = merged.has_point_times;
  }
  for (std::size_t i = 0; i < merged.points.size(); ++i) {
    ScanPoint point = merged.points[i];
    const std::size_t lidar = lidar_of_ring(rig, point.ring);
    if (lidar > 0) {
      const Eigen::Vector3d at = own_from_first[lidar] * Eigen::Vector3d(point.x, point.y, point.z);
      point.x = static_cast<float>(at.x());
      point.y = static_cast<float>(at.y());
      point.z = static_cast<float>(at.z());
      point.ring =
          static_cast<std::uint16_t>(point.ring - rig.further_lidars[lidar - 1].first_ring);
    }
    parts[lidar].scan.points.push_back(point);
    parts[lidar].from.push_back(i);
  }
  return parts;
}

}  // namespace understory
