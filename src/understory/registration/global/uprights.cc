#include "understory/registration/global/uprights.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <tuple>

#include "understory/geometry/voxel_index.h"
#include "understory/registration/global/global_constants.h"

namespace understory {
namespace {

using namespace registration_constants::uprights;

// The slices of a column of the grid in which points lie, and the sums of these.
struct Column {
  int x = 0;
  int y = 0;
  std::uint32_t slices = 0;
  int count = 0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();  // x, y and height of the ground
};

class Columns {
 public:
  Columns(const Points& points, const std::vector<float>& above_m) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      const int slice = static_cast<int>(std::floor((above_m[i] - kLowest) / kSlice));
      if (slice < 0 || slice >= kSlices) continue;
      Column& column = at_point(points[i]);
      column.slices |= 1U << slice;
      ++column.count;
      column.sum += Eigen::Vector3d(points[i].x(), points[i].y(), points[i].z() - above_m[i]);
    }
  }
  [[nodiscard]] const std::vector<Column>& all() const { return columns_; }
  [[nodiscard]] const Column* find(int x, int y) const {
    const std::uint32_t found = index_.find(voxel_key(x, y, 0));
    return found == VoxelIndex::kNone ? nullptr : &columns_[found];
  }

 private:
  Column& at_point(const Eigen::Vector3f& point) {
    const int x = static_cast<int>(std::floor(point.x() / kEdge));
    const int y = static_cast<int>(std::floor(point.y() / kEdge));
    const std::uint64_t key = voxel_key(x, y, 0);
    std::uint32_t found = index_.find(key);
    if (found == VoxelIndex::kNone) {
      found = static_cast<std::uint32_t>(columns_.size());
      index_.set(key, found);
      columns_.push_back({.x = x, .y = y});
    }
    return columns_[found];
  }

  VoxelIndex index_;
  std::vector<Column> columns_;
};

// What stands in the 3 x 3 columns around a column and not in the ring of 40 around these.
Upright upright_at(const Columns& columns, const Column& middle) {
  std::uint32_t own = 0;
  std::array<int, kSlices> beside{};
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
  for (int dy = -3; dy <= 3; ++dy) {
    for (int dx = -3; dx <= 3; ++dx) {
      const Column* column = columns.find(middle.x + dx, middle.y + dy);
      if (column == nullptr) continue;
      if (std::max(std::abs(dx), std::abs(dy)) <= 1) {
        own |= column->slices;
        sum += column->sum;
        count += column->count;
        continue;
      }
      for (int slice = 0; slice < kSlices; ++slice)
        beside[static_cast<std::size_t>(slice)] += (column->slices >> slice & 1U) != 0 ? 1 : 0;
    }
  }
  Upright upright;
  for (int slice = 0; slice < kSlices; ++slice) {
    const bool alone = beside[static_cast<std::size_t>(slice)] <= kMostBeside;
    upright.levels += (own >> slice & 1U) != 0 && alone ? 1 : 0;
  }
  sum /= std::max(count, 1);
  upright.at = sum.head<2>();
  upright.ground_m = sum.z();
  return upright;
}

}  // namespace

std::vector<Upright> find_uprights(const Points& points, const std::vector<float>& above_m,
                                   std::size_t most) {
  const Columns columns(points, above_m);
  std::vector<Upright> found;
  for (const Column& column : columns.all()) {
    if (std::popcount(column.slices) < kLeastOwnLevels) continue;
    const Upright upright = upright_at(columns, column);
    if (upright.levels >= kLeastLevels) found.push_back(upright);
  }
  std::sort(found.begin(), found.end(), [](const Upright& a, const Upright& b) {
    // Many levels show of far things alone: enough is enough, and near things are seen best.
    return std::make_tuple(-std::min(a.levels, kEnoughLevels), a.at.squaredNorm(), a.at.x(),
                           a.at.y()) < std::make_tuple(-std::min(b.levels, kEnoughLevels),
                                                       b.at.squaredNorm(), b.at.x(), b.at.y());
  });
  std::vector<Upright> kept;
  for (const Upright& upright : found) {
    if (kept.size() >= most) break;
    const bool known = std::any_of(kept.begin(), kept.end(), [&](const Upright& other) {
      return (other.at - upright.at).squaredNorm() < kOnePlace * kOnePlace;
    });
    if (!known) kept.push_back(upright);
  }
  return kept;
}

}  // namespace understory
