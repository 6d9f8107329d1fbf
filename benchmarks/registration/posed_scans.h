#pragma once

#include <cstddef>
#include <cstdio>
#include <fstream>
#include <string>

#include "understory/geometry/points.h"
#include "understory/geometry/pose.h"
#include "understory/recording/clouds/cloud_file.h"
#include "understory/registration/global/search_cloud.h"
#include "understory/util/log.h"

namespace understory::benchmarks {

// Calls act(points in the frame of their lidar, true pose world_from_lidar) for each scan of a
// folder that pair_scans wrote, in order.
template <typename Act>
void for_each_posed_scan(const std::string& folder, Log& log, const Act& act) {
  std::ifstream poses(folder + "/poses.txt");
  for (int i = 0;; ++i) {
    Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
    for (int k = 0; k < 12; ++k)
      poses >> matrix(k / 4, k % 4);
    if (!poses) return;
    char name[32];
    std::snprintf(name, sizeof name, "/scan_%03d.bin", i);
    act(read_cloud(folder + name, log).points, Pose::from_matrix(matrix));
  }
}

// Share of the source's points that lie near the target at a pose, 0 to 1.
inline double overlap(const SearchCloud& target, const SearchCloud& source, const Pose& pose) {
  std::size_t near = 0;
  for (const Eigen::Vector3f& point : source.points)
    near += target.near->near((pose * point.cast<double>()).cast<float>()) ? 1 : 0;
  return static_cast<double>(near) / static_cast<double>(source.points.size());
}

}  // namespace understory::benchmarks
