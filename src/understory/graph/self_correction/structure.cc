#include "understory/graph/self_correction/structure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "understory/geometry/voxel_key.h"
#include "understory/graph/graph_constants.h"

namespace understory {
namespace {

using namespace graph_constants::structure;

// The third lowest height of a column: a few stray returns below the ground do no harm.
struct Lowest {
  std::array<float, 3> z{std::numeric_limits<float>::infinity(),
                         std::numeric_limits<float>::infinity(),
                         std::numeric_limits<float>::infinity()};
  void add(float height) {
    if (height >= z[2]) return;
    z[2] = height;
    std::sort(z.begin(), z.end());
  }
};

int cell_of(double value, double size) {
  return static_cast<int>(std::floor(value / size));
}

}  // namespace

std::uint64_t Structure::column(double x, double y) {
  return voxel_key(cell_of(x, kColumn), cell_of(y, kColumn), 0);
}

Structure::Structure(const Points& levelled, double low_m, double high_m, double cell_m)
    : cell_m_(cell_m) {
  std::unordered_map<std::uint64_t, Lowest> ground;
  for (const Eigen::Vector3f& p : levelled) {
    ground[column(p.x(), p.y())].add(p.z());
    seen_.insert(column(p.x(), p.y()));
  }
  for (const Eigen::Vector3f& p : levelled) {
    // Of this column alone: on a slope, its neighbours would make ground look like structure. A
    // column that saw a crown only loses its lower part, which does little harm.
    const float lowest = ground.at(column(p.x(), p.y())).z[2];
    const float height = p.z() - lowest;
    if (height >= static_cast<float>(low_m) && height <= static_cast<float>(high_m))
      points_.push_back(p);
  }
  for (const Eigen::Vector3f& p : points_) {
    const int x = cell_of(p.x(), cell_m_);
    const int y = cell_of(p.y(), cell_m_);
    const int z = cell_of(p.z(), cell_m_);
    for (int dx = -1; dx <= 1; ++dx) {
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dz = -1; dz <= 1; ++dz)
          cells_.insert(voxel_key(x + dx, y + dy, z + dz));
      }
    }
  }
}

double Structure::overlap(const Points& source, const Pose& this_from_source,
                          std::size_t min_points) const {
  std::size_t looked = 0;
  std::size_t hit = 0;
  for (const Eigen::Vector3f& point : source) {
    const Eigen::Vector3d p = this_from_source * point.cast<double>();
    if (!seen_.contains(column(p.x(), p.y()))) continue;
    ++looked;
    if (cells_.contains(
            voxel_key(cell_of(p.x(), cell_m_), cell_of(p.y(), cell_m_), cell_of(p.z(), cell_m_))))
      ++hit;
  }
  if (looked < std::max<std::size_t>(min_points, 1)) return 0.0;
  return static_cast<double>(hit) / static_cast<double>(looked);
}

}  // namespace understory
