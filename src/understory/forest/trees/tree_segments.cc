#include "understory/forest/trees/tree_segments.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <unordered_set>

#include "understory/forest/forest_constants.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace forest_constants::tree_segments;

std::uint64_t cube_of(const Eigen::Vector3d& p) {
  const double size = p.z() > kLowFromM && p.z() < kLowToM ? kLowThin : kThin;
  const auto part = [&](double v) {
    return static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(v / size)) + (1 << 20)) &
           0x1fffff;
  };
  return part(p.x()) << 42 | part(p.y()) << 21 | part(p.z());
}

std::vector<Tree> spread_over_diameters(std::vector<Tree> trees, int most) {
  std::erase_if(trees, [](const Tree& tree) { return std::isnan(tree.dbh_m); });
  sort_stably(trees, [](const Tree& a, const Tree& b) { return a.dbh_m > b.dbh_m; });
  std::vector<Tree> chosen;
  const auto n = static_cast<int>(trees.size());
  const int count = std::min(most, n);
  for (int i = 0; i < count; ++i) {
    // The middle of each of equal parts: neither the very largest nor the very smallest.
    chosen.push_back(trees[static_cast<std::size_t>((2 * i + 1) * n / (2 * count))]);
  }
  return chosen;
}

}  // namespace

std::vector<TreeSegment> collect_segments(const PointBlocks& cloud, const GroundModel& ground,
                                          const std::vector<Tree>& trees, int most,
                                          double reach_m) {
  const std::vector<Tree> chosen = spread_over_diameters(trees, most);
  std::vector<TreeSegment> segments;
  std::vector<std::unordered_set<std::uint64_t>> taken(chosen.size());
  for (const Tree& tree : chosen)
    segments.push_back({tree.id, {}});
  if (chosen.empty()) return segments;
  cloud([&](std::span<const Eigen::Vector3d> points) {
    for (const Eigen::Vector3d& point : points) {
      for (std::size_t i = 0; i < chosen.size(); ++i) {
        if (std::abs(point.x() - chosen[i].x) > reach_m ||
            std::abs(point.y() - chosen[i].y) > reach_m ||
            segments[i].points.size() >= kMostPoints) {
          continue;
        }
        const double height = ground.height_above(point);
        if (std::isnan(height) || height < -1.0) continue;
        const Eigen::Vector3d local(point.x() - chosen[i].x, point.y() - chosen[i].y, height);
        if (taken[i].insert(cube_of(local)).second) {
          segments[i].points.push_back(local.cast<float>());
        }
      }
    }
  });
  return segments;
}

}  // namespace understory
