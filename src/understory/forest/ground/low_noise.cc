#include "understory/forest/ground/low_noise.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "understory/forest/cell_grid.h"
#include "understory/forest/forest_constants.h"

namespace understory {
namespace {

using namespace forest_constants::low_noise;

// How many points a cell has by height, in steps, ascending.
struct Column {
  std::vector<std::pair<int, std::uint32_t>> counts;

  void add(int step) {
    auto at = std::lower_bound(counts.begin(), counts.end(), std::pair(step, std::uint32_t{0}));
    if (at == counts.end() || at->first != step) at = counts.insert(at, {step, 0});
    ++at->second;
  }
  // The step at which the lowest layer begins; nothing below any other if there is none.
  [[nodiscard]] float lowest_layer() const {
    std::uint64_t all = 0;
    for (const auto& [step, count] : counts)
      all += count;
    const double wanted = std::max<double>(kLeast, kLeastShare * static_cast<double>(all));
    for (std::size_t i = 0; i < counts.size(); ++i) {
      std::uint32_t within = counts[i].second;
      if (i + 1 < counts.size() && counts[i + 1].first == counts[i].first + 1)
        within += counts[i + 1].second;
      if (within >= wanted) return static_cast<float>(counts[i].first);
    }
    return std::numeric_limits<float>::quiet_NaN();
  }
};

}  // namespace

LowNoise::LowNoise(const PointBlocks& cloud) {
  CellGrid<Column> columns(kCell);
  bool first = true;
  double z0 = 0.0;
  cloud([&](std::span<const Eigen::Vector3d> points) {
    for (const Eigen::Vector3d& point : points) {
      if (first) z0 = std::floor(point.z());
      first = false;
      const double step = std::floor((point.z() - z0) / kStep);
      if (std::abs(step) > 1e6) continue;
      columns.at(point.x(), point.y()).add(static_cast<int>(step));
    }
  });
  lowest_ = raster_over(columns, 0.0, 0.0, [](Raster& raster, std::size_t at, const Column& cell) {
    raster.values[at] = static_cast<float>(kStep) * cell.lowest_layer();
  });
  lowest_.z0 = z0;
}

bool LowNoise::holds(const Eigen::Vector3d& point) const {
  return point.z() < lowest_.cell_value(point.x(), point.y()) - kMargin;  // false for NaN
}

}  // namespace understory
