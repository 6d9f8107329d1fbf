#include "understory/forest/stems/standing_direction.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <tuple>
#include <unordered_map>

#include "understory/forest/stem_constants.h"
#include "understory/geometry/rotation_between.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace stem_constants::standing_direction;

using Eigen::Vector2d;
using Eigen::Vector3d;

std::uint64_t key_of(const Vector3d& point, double edge) {
  std::uint64_t key = 0;
  for (int axis = 0; axis < 3; ++axis)  // 21 bits each
    key = key << 21U |
          (static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(point[axis] / edge))) &
           0x1fffffU);
  return key;
}

std::vector<Vector3d> one_of_each_voxel(const std::vector<Vector3d>& points) {
  std::vector<std::pair<std::uint64_t, std::size_t>> keys;
  keys.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i)
    keys.emplace_back(key_of(points[i], kVoxel), i);
  std::sort(keys.begin(), keys.end());
  std::vector<Vector3d> result;
  for (std::size_t k = 0; k < keys.size(); ++k) {
    if (k == 0 || keys[k].first != keys[k - 1].first) result.push_back(points[keys[k].second]);
  }
  return result;
}

// Those that are higher than the lowest of their surroundings, measured across the ground.
std::vector<Vector3d> above_ground(const std::vector<Vector3d>& points, const Vector2d& up_slope) {
  const auto over_plane = [&](const Vector3d& p) { return p.z() - up_slope.dot(p.head<2>()); };
  const auto cell_of = [](const Vector3d& p) { return key_of({p.x(), p.y(), 0.0}, kGroundCell); };
  std::unordered_map<std::uint64_t, double> lowest;
  for (const Vector3d& p : points) {
    const auto [at, is_new] = lowest.try_emplace(cell_of(p), over_plane(p));
    if (!is_new) at->second = std::min(at->second, over_plane(p));
  }
  const double least = kAboveGround * std::sqrt(1.0 + up_slope.squaredNorm());
  std::vector<Vector3d> result;
  for (const Vector3d& p : points) {
    if (over_plane(p) - lowest.at(cell_of(p)) > least) result.push_back(p);
  }
  return result;
}

// Counts of points in columns along an axis.
class ColumnCounts {
 public:
  ColumnCounts(const std::vector<Vector3d>& points, const Vector3d& axis, double cell) {
    const Eigen::Quaterniond turn = rotation_between(axis, Vector3d::UnitZ());
    const Eigen::Matrix<double, 2, 3> across = turn.toRotationMatrix().topRows<2>() / cell;
    std::vector<Vector2d> places;
    places.reserve(points.size());
    Vector2d low = Vector2d::Constant(std::numeric_limits<double>::infinity());
    Vector2d high = -low;
    for (const Vector3d& p : points) {
      places.emplace_back(across * p);
      low = low.cwiseMin(places.back());
      high = high.cwiseMax(places.back());
    }
    const Vector2d size = high - low;
    if (!((size.x() + 1.0) * (size.y() + 1.0) <= kMostCells)) return;  // no stand in metres
    columns_ = static_cast<std::int64_t>(size.x()) + 1;
    rows_ = static_cast<std::int64_t>(size.y()) + 1;
    counts_.assign(static_cast<std::size_t>(columns_ * rows_), 0);
    for (const Vector2d& place : places)
      ++counts_[static_cast<std::size_t>(static_cast<std::int64_t>(place.y() - low.y()) * columns_ +
                                         static_cast<std::int64_t>(place.x() - low.x()))];
  }

  // Pairs of points in one column over pairs in columns that lie near each other. Both grow alike
  // with the number of points, and where the stand is seen from its narrow side.
  [[nodiscard]] double gain() const {
    if (counts_.empty()) return 1.0;
    double same = 0.0;
    std::array<double, 4> apart{};
    for (std::int64_t row = 0; row < rows_; ++row) {
      for (std::int64_t column = 0; column < columns_; ++column) {
        const double here = at(column, row);
        if (here == 0.0) continue;
        same += here * (here - 1.0);
        apart[0] += here * at(column + kApart, row);
        apart[1] += here * at(column, row + kApart);
        apart[2] += here * at(column + kApart - 1, row + kApart - 1);
        apart[3] += here * at(column - kApart + 1, row + kApart - 1);
      }
    }
    const double others = 0.25 * (apart[0] + apart[1] + apart[2] + apart[3]);
    return others > 0.0 ? same / others : 1.0;
  }

 private:
  [[nodiscard]] double at(std::int64_t column, std::int64_t row) const {
    if (column < 0 || column >= columns_ || row >= rows_) return 0.0;
    return counts_[static_cast<std::size_t>(row * columns_ + column)];
  }

  std::int64_t columns_ = 0;
  std::int64_t rows_ = 0;
  std::vector<std::uint32_t> counts_;
};

Vector3d direction(double off_z_deg, double around_deg) {
  const double off = off_z_deg * M_PI / 180.0;
  const double around = around_deg * M_PI / 180.0;
  return {std::sin(off) * std::cos(around), std::sin(off) * std::sin(around), std::cos(off)};
}

// Rings of directions around an axis, about `step_deg` apart.
std::vector<Vector3d> directions_around(const Vector3d& axis, double farthest_deg,
                                        double step_deg) {
  const Eigen::Quaterniond turn = rotation_between(Vector3d::UnitZ(), axis);
  std::vector<Vector3d> directions{axis};
  for (double off = step_deg; off <= farthest_deg + 1e-9; off += step_deg) {
    const int count =
        std::max(6, static_cast<int>(std::ceil(360.0 * std::sin(off * M_PI / 180.0) / step_deg)));
    for (int k = 0; k < count; ++k)
      directions.emplace_back(turn * direction(off, 360.0 * k / count));
  }
  return directions;
}

using Scored = std::pair<double, Vector3d>;

std::vector<Scored> scored(const std::vector<Vector3d>& points,
                           const std::vector<Vector3d>& directions, double cell) {
  std::vector<Scored> result;
  for (const Vector3d& axis : directions)
    result.emplace_back(ColumnCounts(points, axis, cell).gain(), axis);
  sort_stably(result, [](const Scored& a, const Scored& b) { return a.first > b.first; });
  return result;
}

}  // namespace

std::optional<StandingDirection> standing_direction(const std::vector<Vector3d>& points,
                                                    const Vector2d& up_slope) {
  std::vector<Vector3d> standing = one_of_each_voxel(above_ground(points, up_slope));
  if (standing.size() < kLeastVoxels) return std::nullopt;
  const std::size_t step = standing.size() / kMostVoxels + 1;
  std::vector<Vector3d> thinned;
  for (std::size_t i = 0; i < standing.size(); i += step)
    thinned.push_back(standing[i]);
  const auto coarse =
      scored(thinned, directions_around(Vector3d::UnitZ(), kFarthestDeg, kCoarseDeg), kCoarseCell);
  StandingDirection found;
  found.gain_of_z = 0.0;
  for (const Scored& each :
       scored(thinned, directions_around(Vector3d::UnitZ(), kNearZDeg, 2.0), kCell))
    found.gain_of_z = std::max(found.gain_of_z, each.first);
  found.gain = found.gain_of_z;
  for (std::size_t k = 0; k < std::min(kFinalists, coarse.size()); ++k) {
    const Scored best =
        scored(thinned, directions_around(coarse[k].second, kCoarseDeg, 2.0), kCell).front();
    if (best.first > found.gain) std::tie(found.gain, found.axis) = best;
  }
  return found;
}

}  // namespace understory
