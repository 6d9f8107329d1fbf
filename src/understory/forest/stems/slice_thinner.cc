#include "understory/forest/stems/slice_thinner.h"

#include <algorithm>
#include <cmath>

namespace understory {

void SliceThinner::add(double x, double y, double height_m) {
  const double size = cube_m_ > 0.0 ? cube_m_ : 1e-4;
  // 24 bits of x and of y and 16 of the height: 250 km at 1.5 cm.
  const auto part = [&](double value, std::int64_t middle, std::uint64_t mask) {
    return static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(value / size)) +
                                      middle) &
           mask;
  };
  const std::uint64_t cube = part(y, 1 << 23, 0xffffff) << 40 | part(x, 1 << 23, 0xffffff) << 16 |
                             part(height_m, 1 << 15, 0xffff);
  if (entries_.capacity() < limit_) entries_.reserve(limit_);
  entries_.push_back(
      {cube, static_cast<float>(x), static_cast<float>(y), static_cast<float>(height_m), 1});
  if (entries_.size() >= limit_) {
    compact();
    limit_ = std::max(limit_, entries_.size() + entries_.size() / 2);
  }
}

void SliceThinner::compact() {
  // In place: a stable sort would take the same memory again.
  std::sort(entries_.begin(), entries_.end(),
            [](const Entry& a, const Entry& b) { return a.cube < b.cube; });
  std::size_t kept = 0;
  for (std::size_t i = 0; i < entries_.size();) {
    const std::uint64_t cube = entries_[i].cube;
    double x = 0.0;
    double y = 0.0;
    double height = 0.0;
    double returns = 0.0;
    for (; i < entries_.size() && entries_[i].cube == cube; ++i) {
      const Entry& entry = entries_[i];
      const auto weight = static_cast<double>(entry.returns);
      x += weight * static_cast<double>(entry.x);
      y += weight * static_cast<double>(entry.y);
      height += weight * static_cast<double>(entry.height_m);
      returns += weight;
    }
    entries_[kept++] = {cube, static_cast<float>(x / returns), static_cast<float>(y / returns),
                        static_cast<float>(height / returns), static_cast<std::uint32_t>(returns)};
  }
  entries_.resize(kept);
}

std::vector<SlicePoint> SliceThinner::take() {
  compact();
  std::vector<SlicePoint> points;
  points.reserve(entries_.size());
  for (const Entry& entry : entries_)
    points.push_back({entry.x, entry.y, entry.height_m, entry.returns});
  entries_ = {};
  return points;
}

}  // namespace understory
