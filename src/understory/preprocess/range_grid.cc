#include "understory/preprocess/range_grid.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

namespace understory {
namespace {

constexpr int kNearestLevel = 3;  // cells of level 0 are those of ranges up to 2^-3 m

// Cells in the order in which they are looked at: the place's own first.
int step_of(int cell) {
  constexpr std::array<int, 3> kSteps = {0, -1, 1};
  return kSteps[static_cast<std::size_t>(cell)];
}

}  // namespace

// The exponent of the number: std::ilogb takes longer.
int RangeGrid::octave_of(float range) {
  const auto bits = std::bit_cast<std::uint32_t>(unit(std::max(0.0F, range)));
  return static_cast<int>(bits >> 23U) - 127;
}

int RangeGrid::level_of(float range) {
  return std::clamp(octave_of(range) + kNearestLevel + 1, 0, kLevels - 1);
}

RangeGrid::RangeGrid(const Points& points, const std::vector<float>& range, double reach,
                     double moved_m)
    : reach_(static_cast<float>(reach)) {
  for (int level = 0; level < kLevels; ++level) {
    levels_[static_cast<std::size_t>(level)].side_m =
        reach_ * std::ldexp(1.0F, level - kNearestLevel);
  }
  entries_.reserve(points.size() + points.size() / 2);
  const auto moved = static_cast<float>(moved_m);
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const float slack = reach_ * unit(range[i]) + moved;
    const int last = level_of(range[i] + slack);
    for (int level = level_of(range[i] - slack); level <= last; ++level)
      add(level, points[i], i);
  }
}

void RangeGrid::add(int level, const Eigen::Vector3f& place, std::uint32_t point) {
  Level& cells = levels_[static_cast<std::size_t>(level)];
  const std::uint64_t key =
      voxel_key(voxel_floor(place.x() / cells.side_m), voxel_floor(place.y() / cells.side_m),
                voxel_floor(place.z() / cells.side_m));
  const auto entry = static_cast<std::uint32_t>(entries_.size());
  entries_.push_back({place, point, cells.first.find(key)});
  cells.first.set(key, entry);
}

float RangeGrid::Nearest::apart() const {
  return std::cbrt(first * first * second);
}

RangeGrid::Nearest RangeGrid::nearest(const Eigen::Vector3f& place, float range, float enough,
                                      std::uint32_t but) const {
  static_assert(VoxelIndex::kNone == kNoPoint);
  const Level& cells = levels_[static_cast<std::size_t>(level_of(range))];
  const float metres = unit(range);
  const float stop2 = enough * metres * enough * metres;
  float first2 = reach_ * reach_ * metres * metres;
  float second2 = first2;
  const int x = voxel_floor(place.x() / cells.side_m);
  const int y = voxel_floor(place.y() / cells.side_m);
  const int z = voxel_floor(place.z() / cells.side_m);
  for (int cell = 0; cell < 27; ++cell) {
    std::uint32_t at = cells.first.find(
        voxel_key(x + step_of(cell % 3), y + step_of(cell / 3 % 3), z + step_of(cell / 9)));
    for (; at != kNoPoint; at = entries_[at].next) {
      if (entries_[at].point == but) continue;
      const float distance2 = (entries_[at].place - place).squaredNorm();
      second2 = std::min(second2, std::max(first2, distance2));
      first2 = std::min(first2, distance2);
    }
    if (first2 * first2 * second2 <= stop2 * stop2 * stop2) break;
  }
  return {std::sqrt(first2) / metres, std::sqrt(second2) / metres};
}

}  // namespace understory
