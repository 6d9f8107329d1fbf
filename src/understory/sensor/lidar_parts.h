#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "understory/sensor/rig.h"
#include "understory/sensor/scan.h"

namespace understory {

// Which lidar of a merged scan a ring belongs to, counted from 0.
[[nodiscard]] inline std::size_t lidar_of_ring(const Rig& rig, std::uint16_t ring) {
  std::size_t lidar = 0;
  for (const FurtherLidar& further : rig.further_lidars) {
    if (further.first_ring == 0 || ring < further.first_ring) break;
    ++lidar;
  }
  return lidar;
}

// Where the rays of each ring of a merged scan begin. Thread-safe once made.
class RayOrigins {
 public:
  explicit RayOrigins(const Rig& rig) {
    for (const FurtherLidar& further : rig.further_lidars) {
      if (further.first_ring == 0) continue;
      first_rings_.push_back(further.first_ring);
      places_.emplace_back(further.lidar_from_further.translation().cast<float>());
    }
  }
  // From a point in the frame of the first lidar to the lidar that measured it, metres.
  [[nodiscard]] float range(const ScanPoint& point) const {
    std::size_t number = 0;
    while (number < first_rings_.size() && point.ring >= first_rings_[number])
      ++number;
    if (number == 0) return std::sqrt(point.x * point.x + point.y * point.y + point.z * point.z);
    return (Eigen::Vector3f(point.x, point.y, point.z) - places_[number - 1]).norm();
  }

 private:
  std::vector<std::uint16_t> first_rings_;
  std::vector<Eigen::Vector3f> places_;
};

// What one lidar measured of a merged scan: in its own frame and with its own rings.
struct LidarPart {
  Scan scan;
  Pose body_from_lidar;
  std::vector<std::size_t> from;  // of each point: its number in the merged scan
};
// One for each lidar, the first one's first.
[[nodiscard]] std::vector<LidarPart> lidar_parts(const Scan& merged, const Rig& rig);

}  // namespace understory
