#include "understory/forest/stems/stem_surroundings.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
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
  return stem.radius_m + kReach + kReachPerMetre * std::max(0.0, height_m - kBreastHeight);
}

std::uint64_t surrounding_cube(const SlicePoint& point) {
  const auto part = [](float value) {
    return static_cast<std::uint64_t>(
               static_cast<std::int64_t>(std::floor(static_cast<double>(value) / kCube)) +
               (1 << 20)) &
           0x1fffff;
  };
  return part(point.height_m) << 42 | part(point.y) << 21 | part(point.x);
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
    const SlicePoint local{static_cast<float>(point.x()), static_cast<float>(point.y()),
                           static_cast<float>(height), 1};
    entries_.push_back({surrounding_cube(local), i, local});
  }
  if (entries_.size() < limit_) return;
  compact();
  limit_ = std::max(limit_, entries_.size() + entries_.size() / 2);
}

void StemSurroundings::compact() {
  const auto order = [](const Entry& e) {
    return std::tuple(e.stem, e.cube, e.point.height_m, e.point.x, e.point.y);
  };
  std::sort(entries_.begin(), entries_.end(),
            [&](const Entry& a, const Entry& b) { return order(a) < order(b); });
  std::size_t kept = 0;
  for (std::size_t i = 0; i < entries_.size();) {
    const Entry first = entries_[i];
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    std::uint32_t returns = 0;
    for (; i < entries_.size() && entries_[i].stem == first.stem && entries_[i].cube == first.cube;
         ++i) {
      const SlicePoint& p = entries_[i].point;
      sum += static_cast<double>(p.returns) * Eigen::Vector3f(p.x, p.y, p.height_m).cast<double>();
      returns += p.returns;
    }
    const Eigen::Vector3f mean = (sum / returns).cast<float>();
    entries_[kept++] = {first.cube, first.stem, {mean.x(), mean.y(), mean.z(), returns}};
  }
  entries_.resize(kept);
}

std::vector<std::vector<SlicePoint>> StemSurroundings::take() {
  compact();
  std::vector<std::vector<SlicePoint>> points(stems_.size());
  for (const Entry& entry : entries_)
    points[entry.stem].push_back(entry.point);
  entries_ = {};
  return points;
}

}  // namespace understory
