#include "understory/forest/search/cell_index.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "understory/forest/stem_constants.h"

namespace understory {

using stem_constants::circle_search::kStretch;

LivePoints::LivePoints(std::size_t count) : alive_(count, 1), sums_(count + 1, 0), size_(count) {
  for (std::size_t i = 1; i <= count; ++i)
    sums_[i] = static_cast<std::uint32_t>(i & (~i + 1));
}

std::uint32_t LivePoints::at(std::size_t k) const {
  std::size_t found = 0;
  for (std::size_t step = std::bit_floor(alive_.size()); step > 0; step /= 2) {
    const std::size_t next = found + step;
    if (next >= sums_.size() || sums_[next] > k) continue;
    found = next;
    k -= sums_[next];
  }
  return static_cast<std::uint32_t>(found);
}

void LivePoints::remove(std::uint32_t i) {
  alive_[i] = 0;
  --size_;
  for (std::size_t at = std::size_t{i} + 1; at < sums_.size(); at += at & (~at + 1))
    --sums_[at];
}

CellIndex::CellIndex(const Points& points, const LivePoints& live, const Eigen::Vector2f& low,
                     float cell_m)
    : cell_m_(cell_m), low_(low) {
  Eigen::Vector2f high = low_;
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    if (live.holds(i)) high = high.cwiseMax(points[i]);
  }
  columns_ = column(high.x()) + 1;
  rows_ = row(high.y()) + 1;
  stretches_ = (columns_ + kStretch - 1) / kStretch;
  begin_.assign(
      static_cast<std::size_t>(rows_) * static_cast<std::size_t>(stretches_) * (kStretch + 1), 0);
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    if (live.holds(i)) ++begin_[begin_of(row(points[i].y()), column(points[i].x()))];
  }
  std::uint32_t sum = 0;
  for (std::uint32_t& begin : begin_)
    begin = std::exchange(sum, sum + begin);
  std::vector<std::uint32_t> next = begin_;
  sorted_.resize(live.size());
  ids_.resize(live.size());
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    if (!live.holds(i)) continue;
    const std::uint32_t at = next[begin_of(row(points[i].y()), column(points[i].x()))]++;
    sorted_[at] = points[i];
    ids_[at] = i;
  }
}

// Columns c0 to c1 of a row: one range a stretch.
std::uint32_t CellIndex::add_cells(int r, int c0, int c1, std::vector<Range>* ranges) const {
  std::uint32_t count = 0;
  while (c0 <= c1) {
    const int last = std::min(c1, c0 - c0 % kStretch + kStretch - 1);
    const Range range{begin_[begin_of(r, c0)], begin_[begin_of(r, last) + 1]};
    count += range.second - range.first;
    if (ranges != nullptr && range.first < range.second) ranges->push_back(range);
    c0 = last + 1;
  }
  return count;
}

std::uint32_t CellIndex::square(const Eigen::Vector2f& centre, float reach,
                                std::vector<Range>& ranges) const {
  ranges.clear();
  const int c0 = std::max(0, column(centre.x() - reach));
  const int c1 = std::min(columns_ - 1, column(centre.x() + reach));
  const int r0 = std::max(0, row(centre.y() - reach));
  const int r1 = std::min(rows_ - 1, row(centre.y() + reach));
  std::uint32_t count = 0;
  for (int r = r0; r <= r1; ++r)
    count += add_cells(r, c0, c1, &ranges);
  return count;
}

// Cells of a row follow each other, so a row takes two steps.
std::uint32_t CellIndex::ring(const Eigen::Vector2f& centre, float inner, float outer,
                              std::vector<Range>& ranges) const {
  ranges.clear();
  std::uint32_t within = 0;
  const int r0 = std::max(0, row(centre.y() - outer));
  const int r1 = std::min(rows_ - 1, row(centre.y() + outer));
  for (int r = r0; r <= r1; ++r) {
    const float low = low_.y() + static_cast<float>(r) * cell_m_ - centre.y();
    const float high = low + cell_m_;
    const float nearest = std::max({0.0F, low, -high});
    const float farthest = std::max(-low, high);
    const float wide = std::sqrt(std::max(0.0F, outer * outer - nearest * nearest));
    const int c0 = std::max(0, column(centre.x() - wide));
    const int c1 = std::min(columns_ - 1, column(centre.x() + wide));
    if (c0 > c1) continue;
    const float slim = inner > farthest ? std::sqrt(inner * inner - farthest * farthest) : -1.0F;
    const int i0 = std::max(c0, column(centre.x() - slim) + 1);
    const int i1 = std::min(c1, column(centre.x() + slim) - 1);
    if (slim <= 0.0F || i0 > i1) {
      add_cells(r, c0, c1, &ranges);
      continue;
    }
    add_cells(r, c0, i0 - 1, &ranges);
    add_cells(r, i1 + 1, c1, &ranges);
    within += add_cells(r, i0, i1, nullptr);
  }
  return within;
}

std::size_t CellIndex::forget(const LivePoints& live, const Eigen::Vector2f& centre, float reach) {
  const int c0 = std::max(0, column(centre.x() - reach));
  const int c1 = std::min(columns_ - 1, column(centre.x() + reach));
  const int r0 = std::max(0, row(centre.y() - reach));
  const int r1 = std::min(rows_ - 1, row(centre.y() + reach));
  std::size_t looked_at = 0;
  for (int r = r0; r <= r1 && c0 <= c1; ++r) {
    for (std::size_t stretch = stretch_of(r, c0); stretch <= stretch_of(r, c1); ++stretch)
      looked_at += compact(stretch, live);
  }
  return looked_at;
}

// Moves the live points of a stretch up, in their order.
std::size_t CellIndex::compact(std::size_t stretch, const LivePoints& live) {
  std::uint32_t* begin = begin_.data() + stretch * (kStretch + 1);
  const std::uint32_t first = begin[0];
  std::uint32_t from = first;
  std::uint32_t to = first;
  for (int c = 0; c < kStretch; ++c) {
    for (; from < begin[c + 1]; ++from) {
      if (!live.holds(ids_[from])) continue;
      sorted_[to] = sorted_[from];
      ids_[to++] = ids_[from];
    }
    begin[c + 1] = to;
  }
  return from - first;
}

}  // namespace understory
