#include "understory/forest/slice/slice_thinner.h"

#include <algorithm>
#include <cmath>

namespace understory {
namespace {

// 24 bits of x and of y and 16 of the height: 250 km at 1.5 cm.
constexpr std::int64_t kMiddle = 1 << 23;
constexpr std::int64_t kMiddleHeight = 1 << 15;
constexpr double kSmallest = 0.001;  // m

}  // namespace

SliceThinner::SliceThinner(double cube_m) : cube_m_(std::max(cube_m, kSmallest)) {}

void SliceThinner::add(double x, double y, double height_m) {
  const Eigen::Array3d in_cubes = Eigen::Array3d(x, y, height_m) / cube_m_;
  const Eigen::Array3d number = in_cubes.floor();
  if (!(number.head<2>().abs() < static_cast<double>(kMiddle)).all() ||
      !(std::abs(number.z()) < static_cast<double>(kMiddleHeight)))
    return;
  const auto part = [&](int axis, std::int64_t middle) {
    return static_cast<std::uint64_t>(static_cast<std::int64_t>(number[axis]) + middle);
  };
  if (entries_.capacity() < limit_) entries_.reserve(limit_);
  entries_.push_back({part(1, kMiddle) << 40 | part(0, kMiddle) << 16 | part(2, kMiddleHeight),
                      CubeMean(in_cubes)});
  if (entries_.size() >= limit_) {
    compact();
    limit_ = std::max(limit_, entries_.size() + entries_.size() / 2);
  }
}

Eigen::Vector2d SliceThinner::corner_of(double x, double y) const {
  return {cube_m_ * std::floor(x / cube_m_), cube_m_ * std::floor(y / cube_m_)};
}

void SliceThinner::compact() {
  // In place: a stable sort would take the same memory again.
  std::sort(entries_.begin(), entries_.end(),
            [](const Entry& a, const Entry& b) { return a.cube < b.cube; });
  std::size_t kept = 0;
  for (std::size_t i = 0; i < entries_.size();) {
    Entry whole = entries_[i];
    for (++i; i < entries_.size() && entries_[i].cube == whole.cube; ++i)
      whole.mean.add(entries_[i].mean);
    entries_[kept++] = whole;
  }
  entries_.resize(kept);
}

SlicePoint SliceThinner::point_of(const Entry& entry) const {
  const auto number = [&](int shift, std::uint64_t mask, std::int64_t middle) {
    return static_cast<std::int64_t>(entry.cube >> shift & mask) - middle;
  };
  const auto metres = [&](std::size_t axis, std::int64_t cube) {
    return static_cast<float>(cube_m_ * entry.mean.in_cubes(axis, cube));
  };
  return {metres(0, number(16, 0xffffff, kMiddle)), metres(1, number(40, 0xffffff, kMiddle)),
          metres(2, number(0, 0xffff, kMiddleHeight)), entry.mean.returns()};
}

std::vector<SlicePoint> SliceThinner::take() {
  compact();
  std::vector<SlicePoint> points;
  points.reserve(entries_.size());
  for (const Entry& entry : entries_)
    points.push_back(point_of(entry));
  entries_ = {};
  return points;
}

}  // namespace understory
