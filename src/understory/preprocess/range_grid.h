#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "understory/geometry/points.h"
#include "understory/geometry/voxel_index.h"

namespace understory {

// The points of a scan in cells that grow with the distance from the lidar. Neighbours as far as a
// share of that distance are then found in constant time. Immutable, thread-safe.
class RangeGrid {
 public:
  static constexpr std::uint32_t kNoPoint = UINT32_MAX;

  RangeGrid() = default;
  // `range`: metres from the lidar, one for each point. `reach`: the share, above 0. `moved_m`: how
  // far from its place at the scan the lidar may be when it asks; beyond it points are missed.
  RangeGrid(const Points& points, const std::vector<float>& range, double reach, double moved_m);

  // Distances to the nearest point and to the second nearest, as shares of `unit(range)`; the reach
  // where none is as near.
  struct Nearest {
    float first = 0.0F;
    float second = 0.0F;
    // What counts as the distance of both: cbrt(first^2 second).
    [[nodiscard]] float apart() const;
  };
  // From a place. Ends early with larger distances, as soon as `apart` of them is not above
  // `enough`. `range`: of the place from the lidar; `but`: a point that does not count.
  [[nodiscard]] Nearest nearest(const Eigen::Vector3f& place, float range, float enough,
                                std::uint32_t but = kNoPoint) const;
  // What distances are a share of, metres: the errors of a lidar do not vanish close by.
  [[nodiscard]] static float unit(float range) { return 0.1F + range; }

  // Floor of the binary logarithm of `unit(range)`; a range below 0 or none counts as 0.
  [[nodiscard]] static int octave_of(float range);

 private:
  static constexpr int kLevels = 16;
  struct Level {
    float side_m = 1.0F;
    VoxelIndex first;  // entry of a cell
  };
  struct Entry {
    Eigen::Vector3f place;
    std::uint32_t point;
    std::uint32_t next;  // of the cell, or kNoPoint
  };
  [[nodiscard]] static int level_of(float range);
  void add(int level, const Eigen::Vector3f& place, std::uint32_t point);

  float reach_ = 0.05F;
  std::array<Level, kLevels> levels_;
  std::vector<Entry> entries_;
};

}  // namespace understory
