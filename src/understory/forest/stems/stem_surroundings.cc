#include "understory/forest/stems/stem_surroundings.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "understory/forest/stem_curve_constants.h"
#include "understory/forest/stems/stem_axis.h"
#include "understory/forest/trees/tree_heights.h"

namespace understory {
namespace {

using namespace stem_constants::stem_surroundings;

Eigen::Vector2i square_of(const Eigen::Vector2d& place) {
  return (place / kSquare).array().floor().cast<int>();
}

std::uint64_t square_key(const Eigen::Vector2i& square) {
  return static_cast<std::uint64_t>(static_cast<std::uint32_t>(square.x())) << 32 |
         static_cast<std::uint32_t>(square.y());
}

// How far from the straight centre line the surface of a stem may be.
double reach_at(const StemFit& stem, double height_m) {
  const double bent = kReach + kReachPerMetre * std::max(0.0, height_m - kBreastHeight);
  const double beside = height_m < kForksUpTo ? kForkReach : 0.0;
  return stem.radius_m + std::max(bent, beside);
}

constexpr std::int64_t kMiddleCube = 1 << 20;  // 21 bits each

// The number of a cube; nothing where it has no room.
std::optional<std::uint64_t> surrounding_cube(const Eigen::Array3d& in_cubes) {
  const Eigen::Array3d number = in_cubes.floor();
  if (!(number.abs() < static_cast<double>(kMiddleCube)).all()) return std::nullopt;
  const auto part = [&](int axis) {
    return static_cast<std::uint64_t>(static_cast<std::int64_t>(number[axis]) + kMiddleCube);
  };
  return part(2) << 42 | part(1) << 21 | part(0);
}

SlicePoint mean_in_cube(std::uint64_t cube, const CubeMean& mean) {
  const auto metres = [&](std::size_t axis) {
    const auto number = static_cast<std::int64_t>(cube >> (21 * axis) & 0x1fffff) - kMiddleCube;
    return static_cast<float>(kCube * mean.in_cubes(axis, number));
  };
  return {metres(0), metres(1), metres(2), mean.returns()};
}

}  // namespace

StemSurroundings::StemSurroundings(const std::vector<StemFit>& stems, std::vector<double> ground_m)
    : stems_(stems), ground_m_(std::move(ground_m)), limit_(kFirstLimit) {
  for (std::size_t i = 0; i < stems.size(); ++i) {
    const Eigen::Vector2d reach = Eigen::Vector2d::Constant(reach_at(stems[i], kHighest));
    const Eigen::Vector2d foot = stem_place_at(stems[i], 0.0);
    const Eigen::Vector2d end = stem_place_at(stems[i], std::numeric_limits<double>::infinity());
    const Eigen::Vector2i low = square_of(foot.cwiseMin(end) - reach);
    const Eigen::Vector2i high = square_of(foot.cwiseMax(end) + reach);
    for (int y = low.y(); y <= high.y(); ++y) {
      for (int x = low.x(); x <= high.x(); ++x)
        near_[square_key({x, y})].push_back(static_cast<std::uint32_t>(i));
    }
  }
}

void StemSurroundings::add(const Eigen::Vector3d& point) {
  const auto near = near_.find(square_key(square_of(point.head<2>())));
  if (near == near_.end()) return;
  for (const std::uint32_t i : near->second) {
    const double height = point.z() - ground_m_[i];
    if (!(height >= 0.0 && height <= kHighest)) continue;
    const double reach = reach_at(stems_[i], height);
    const Eigen::Vector2d off = point.head<2>() - stem_place_at(stems_[i], height);
    if (off.squaredNorm() > reach * reach) continue;
    const Eigen::Array3d in_cubes = Eigen::Array3d(point.x(), point.y(), height) / kCube;
    if (const auto cube = surrounding_cube(in_cubes))
      entries_.push_back({*cube, i, CubeMean(in_cubes)});
  }
  if (entries_.size() < limit_) return;
  compact();
  limit_ = std::max(limit_, entries_.size() + entries_.size() / 2);
}

void StemSurroundings::compact() {
  std::sort(entries_.begin(), entries_.end(), [](const Entry& a, const Entry& b) {
    return a.stem != b.stem ? a.stem < b.stem : a.cube < b.cube;
  });
  std::size_t kept = 0;
  for (std::size_t i = 0; i < entries_.size();) {
    Entry whole = entries_[i];
    for (++i;
         i < entries_.size() && entries_[i].stem == whole.stem && entries_[i].cube == whole.cube;
         ++i)
      whole.mean.add(entries_[i].mean);
    entries_[kept++] = whole;
  }
  entries_.resize(kept);
}

std::vector<std::vector<SlicePoint>> StemSurroundings::take() {
  compact();
  std::vector<std::vector<SlicePoint>> points(stems_.size());
  for (const Entry& entry : entries_)
    points[entry.stem].push_back(mean_in_cube(entry.cube, entry.mean));
  entries_ = {};
  return points;
}

}  // namespace understory
