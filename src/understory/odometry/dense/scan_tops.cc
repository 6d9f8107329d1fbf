#include "understory/odometry/dense/scan_tops.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace understory {
namespace {

Points turned(const Points& points, const Pose& world_from_body) {
  const Eigen::Matrix3f rotation = world_from_body.rotation_matrix().cast<float>();
  Points level;
  level.reserve(points.size());
  for (const Eigen::Vector3f& point : points)
    level.emplace_back(rotation * point);
  return level;
}

}  // namespace

void describe(ConfigTable& table, ScanTopsConfig& config) {
  table.add_enum("points", config.points,
                 {{"all", ScanPoints::kAll}, {"tree_tops", ScanPoints::kTreeTops}},
                 "which points are matched and enter the local map: all, or tree tops with their "
                 "neighbours, for a lidar above young trees");
  table.section("tree_tops", [&] {
    table.add("window_m", config.top.window_m, {0.1, 20.0}, "m",
              "a tree top is the highest point within this radius in the plane");
    table.add("neighbour_m", config.top.neighbour_m, {0.1, 20.0}, "m",
              "points within this radius in space count as neighbours of a top");
    table.add("least_neighbours", config.top.least_neighbours, {3, 10000}, "",
              "tops with fewer neighbours are left out");
    table.add(
        "least_eigenvalue_m2", config.top.least_eigenvalue_m2, {0.0, 10.0}, "m²",
        "least eigenvalue of the scatter matrix of the neighbours: wires and walls have less");
    table.add("least_points", config.least_points, {1, 1000000}, "",
              "a scan with fewer points around its tops is matched with all its points");
  });
}

std::optional<BodyCloud> keep_tree_tops(const BodyCloud& cloud, const Pose& world_from_body,
                                        const ScanTopsConfig& config) {
  if (config.points == ScanPoints::kAll) return std::nullopt;
  const Points level = turned(cloud.points, world_from_body);
  const std::vector<TreeTop> tops = find_tree_tops(level, config.top);
  if (tops.empty()) return std::nullopt;
  const std::vector<std::size_t> kept = top_indices(level.size(), tops);
  if (static_cast<int>(kept.size()) < config.least_points) return std::nullopt;
  BodyCloud around;
  around.stamp = cloud.stamp;
  around.resize(kept.size());
  for (std::size_t n = 0; n < kept.size(); ++n) {
    const std::size_t i = kept[n];
    around.points[n] = cloud.points[i];
    around.intensity[n] = cloud.intensity[i];
    around.range[n] = cloud.range[i];
    around.ring[n] = cloud.ring[i];
    around.t_ns[n] = cloud.t_ns[i];
  }
  return around;
}

}  // namespace understory
