#include "understory/preprocess/body_cloud.h"

#include <algorithm>

#include "understory/sensor/rig.h"

namespace understory {

std::vector<std::uint8_t> lidars_of(const std::vector<std::uint16_t>& rings) {
  std::vector<std::uint8_t> lidars;
  if (std::none_of(rings.begin(), rings.end(), [](auto ring) { return ring >= kRingsALidar; }))
    return lidars;
  lidars.reserve(rings.size());
  for (const std::uint16_t ring : rings)
    lidars.push_back(static_cast<std::uint8_t>(ring / kRingsALidar));
  return lidars;
}

std::vector<BodyCloud> clouds_by_lidar(const BodyCloud& cloud) {
  std::vector<BodyCloud> parts(1);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const std::size_t lidar = cloud.ring[i] / kRingsALidar;
    if (lidar >= parts.size()) parts.resize(lidar + 1);
    BodyCloud& part = parts[lidar];
    part.points.push_back(cloud.points[i]);
    part.intensity.push_back(cloud.intensity[i]);
    part.range.push_back(cloud.range[i]);
    part.ring.push_back(cloud.ring[i]);
    part.t_ns.push_back(cloud.t_ns[i]);
    if (!cloud.feature.empty()) part.feature.push_back(cloud.feature[i]);
    if (!cloud.carried.empty()) part.carried.push_back(cloud.carried[i]);
  }
  for (BodyCloud& part : parts)
    part.stamp = cloud.stamp;
  return parts;
}

}  // namespace understory
