#include "understory/forest/search/point_groups.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include "understory/forest/stem_constants.h"

namespace understory {
namespace {

using namespace stem_constants::point_groups;

using PointList = std::vector<Eigen::Vector2f>;
using CellOfPoint = std::pair<std::uint64_t, std::uint32_t>;

constexpr std::int64_t kMiddle = 1LL << 31;

std::uint64_t cell_key(std::int64_t column, std::int64_t row) {
  return static_cast<std::uint64_t>(row + kMiddle) << 32 |
         static_cast<std::uint64_t>(column + kMiddle);
}

std::int64_t number_of(double value, double size) {
  return static_cast<std::int64_t>(std::floor(value / size));
}

// Cells by key, each with the first of the cells that it hangs together with.
class Cells {
 public:
  explicit Cells(const std::vector<CellOfPoint>& sorted) {
    for (const CellOfPoint& cell : sorted) {
      if (keys_.empty() || keys_.back() != cell.first) keys_.push_back(cell.first);
    }
    parent_.resize(keys_.size());
    std::iota(parent_.begin(), parent_.end(), 0U);
    for (std::uint32_t i = 0; i < keys_.size(); ++i)
      join_with_earlier(i);
  }

  [[nodiscard]] std::size_t size() const { return keys_.size(); }
  [[nodiscard]] std::uint64_t key(std::size_t i) const { return keys_[i]; }
  std::uint32_t root(std::uint32_t i) {
    while (parent_[i] != i)
      i = parent_[i] = parent_[parent_[i]];
    return i;
  }

 private:
  void join_with_earlier(std::uint32_t i) {
    const auto row = static_cast<std::int64_t>(keys_[i] >> 32) - kMiddle;
    const auto column = static_cast<std::int64_t>(keys_[i] & 0xffffffffU) - kMiddle;
    constexpr std::array<std::pair<int, int>, 4> kBefore = {{{-1, 0}, {-1, -1}, {0, -1}, {1, -1}}};
    for (const auto& [dx, dy] : kBefore) {
      const std::uint64_t other = cell_key(column + dx, row + dy);
      const auto found = std::lower_bound(keys_.begin(), keys_.end(), other);
      if (found == keys_.end() || *found != other) continue;
      const std::uint32_t a = root(static_cast<std::uint32_t>(found - keys_.begin()));
      const std::uint32_t b = root(i);
      parent_[std::max(a, b)] = std::min(a, b);
    }
  }

  std::vector<std::uint64_t> keys_;
  std::vector<std::uint32_t> parent_;
};

std::vector<PointGroup> groups_of(const PointList& points, const PointGroupConfig& config) {
  std::vector<CellOfPoint> sorted(points.size());
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    sorted[i] = {cell_key(number_of(static_cast<double>(points[i].x()), config.reach_m),
                          number_of(static_cast<double>(points[i].y()), config.reach_m)),
                 i};
  }
  std::sort(sorted.begin(), sorted.end());
  Cells cells(sorted);
  std::vector<PointGroup> groups(cells.size());
  std::uint32_t cell = 0;
  for (const auto& [key, i] : sorted) {
    while (cells.key(cell) != key)
      ++cell;
    groups[cells.root(cell)].points.push_back(points[i]);
  }
  const auto shift_x = static_cast<std::int64_t>(std::llround(config.origin.x() / config.reach_m));
  const auto shift_y = static_cast<std::int64_t>(std::llround(config.origin.y() / config.reach_m));
  for (std::size_t i = 0; i < groups.size(); ++i) {
    groups[i].place = cells.key(i) + (static_cast<std::uint64_t>(shift_y) << 32) +
                      static_cast<std::uint64_t>(shift_x);
  }
  std::erase_if(groups, [&](const PointGroup& group) {
    return static_cast<int>(group.points.size()) < config.min_points;
  });
  return groups;
}

// The windows of the grid with the points in and near them; those in the area.
std::vector<PointGroup> cut(const PointList& points, const PointGroupConfig& config) {
  std::vector<CellOfPoint> sorted;
  const double margin = config.margin_m;
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector2d place = points[i].cast<double>();
    for (auto row = number_of(place.y() - margin, kWindow);
         row <= number_of(place.y() + margin, kWindow); ++row) {
      for (auto column = number_of(place.x() - margin, kWindow);
           column <= number_of(place.x() + margin, kWindow); ++column)
        sorted.emplace_back(cell_key(column, row), i);
    }
  }
  std::sort(sorted.begin(), sorted.end());
  std::vector<PointGroup> groups;
  PointList here;
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    const std::uint64_t key = sorted[i].first;
    here.push_back(points[sorted[i].second]);
    if (i + 1 < sorted.size() && sorted[i + 1].first == key) continue;
    GroundArea window;
    window.low.x() =
        kWindow * static_cast<double>(static_cast<std::int64_t>(key & 0xffffffffU) - kMiddle);
    window.low.y() = kWindow * static_cast<double>(static_cast<std::int64_t>(key >> 32) - kMiddle);
    window.high = window.low.array() + kWindow;
    if (config.area.touches(window.low, window.high)) {
      for (PointGroup& group : groups_of(here, config)) {
        group.window = window;
        groups.push_back(std::move(group));
      }
    }
    here.clear();
  }
  return groups;
}

}  // namespace

double group_margin_m(double max_radius_m, double band_m) {
  return 2.0 * (max_radius_m + 2.0 * band_m);
}

double group_reach_m(double max_radius_m, double band_m) {
  // The far end of a window, and whether a point there belongs to a long group.
  return kWindow + group_margin_m(max_radius_m, band_m) + kLongest + kCellSlack;
}

std::vector<PointGroup> groups_near(const PointList& points, const PointGroupConfig& config) {
  std::vector<PointGroup> groups;
  PointList of_large;
  for (PointGroup& group : groups_of(points, config)) {
    Eigen::Vector2f low = group.points.front();
    Eigen::Vector2f high = low;
    for (const Eigen::Vector2f& point : group.points) {
      low = low.cwiseMin(point);
      high = high.cwiseMax(point);
    }
    if (!config.whole && static_cast<double>((high - low).maxCoeff()) > kLongest) {
      of_large.insert(of_large.end(), group.points.begin(), group.points.end());
    } else if (config.area.touches(low.cast<double>(), high.cast<double>())) {
      groups.push_back(std::move(group));
    }
  }
  for (PointGroup& group : cut(of_large, config))
    groups.push_back(std::move(group));
  return groups;
}

}  // namespace understory
