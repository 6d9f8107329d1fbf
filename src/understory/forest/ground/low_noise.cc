#include "understory/forest/ground/low_noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "understory/forest/cell_grid.h"
#include "understory/forest/forest_constants.h"

namespace understory {
namespace {

using namespace forest_constants::low_noise;

// How many points a cell has by height, in steps. Steps are counted in spans: a cell has one or
// two, and a stray point far away makes another one instead of a long array.
class Column {
 public:
  void add(int step) {
    const int first = step & ~(kSpan - 1);
    auto at = spans_.begin();
    while (at != spans_.end() && at->first < first)
      ++at;
    if (at == spans_.end() || at->first != first) at = spans_.insert(at, {first, {}});
    ++at->counts[static_cast<std::size_t>(step - first)];
    ++all_;
  }
  // The step at which the lowest layer begins; NaN if there is none.
  [[nodiscard]] float lowest_layer() const {
    const double wanted = std::max<double>(kLeast, kLeastShare * static_cast<double>(all_));
    for (std::size_t i = 0; i < spans_.size(); ++i) {
      const bool goes_on = i + 1 < spans_.size() && spans_[i + 1].first == spans_[i].first + kSpan;
      const std::uint32_t after_end = goes_on ? spans_[i + 1].counts.front() : 0;
      for (std::size_t step = 0; step < kSpan; ++step) {
        const auto& counts = spans_[i].counts;
        const std::uint32_t above = step + 1 < kSpan ? counts[step + 1] : after_end;
        if (counts[step] > 0 && counts[step] + above >= wanted)
          return static_cast<float>(spans_[i].first + static_cast<int>(step));
      }
    }
    return std::numeric_limits<float>::quiet_NaN();
  }

 private:
  static constexpr int kSpan = 64;  // steps; a power of two
  struct Span {
    int first;
    std::array<std::uint32_t, kSpan> counts;
  };
  std::vector<Span> spans_;  // ascending
  std::uint64_t all_ = 0;
};

}  // namespace

LowNoise::LowNoise(const PointBlocks& cloud, std::optional<double> level_m) {
  CellGrid<Column> columns(kCell);
  bool first = !level_m;
  double z0 = level_m.value_or(0.0);
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
