#include "understory/forest/trees/canopy_crowns.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <queue>
#include <tuple>

#include "understory/forest/forest_constants.h"

namespace understory {
namespace {

using namespace forest_constants::canopy_crowns;

// Calls visit(index) for the up to eight cells around one.
template <typename Visit>
void around(const Raster& raster, int column, int row, const Visit& visit) {
  for (int r = row - 1; r <= row + 1; ++r) {
    for (int c = column - 1; c <= column + 1; ++c) {
      if ((r != row || c != column) && raster.contains(c, r)) visit(raster.index(c, r));
    }
  }
}

// Cells without a point and cells whose pulses went through the crown take the (lower) median of
// the cells around them. The edges of crowns stay: a pit is low beside most of its neighbours.
Raster filled(const Raster& canopy) {
  Raster result = canopy;
  std::vector<float> near;
  for (int pass = 0; pass < kFillPasses; ++pass) {
    const Raster before = result;
    for (int row = 0; row < canopy.rows; ++row) {
      for (int column = 0; column < canopy.columns; ++column) {
        near.clear();
        around(before, column, row, [&](std::size_t i) {
          if (std::isfinite(before.values[i])) near.push_back(before.values[i]);
        });
        if (near.size() < kLeastAround) continue;
        std::sort(near.begin(), near.end());
        const float median = near[(near.size() - 1) / 2];
        float& value = result.values[before.index(column, row)];
        const bool pit = near.size() >= kAroundPit && value < near[near.size() - kAroundPit] - kPit;
        if (!std::isfinite(value) || pit) value = median;
      }
    }
  }
  return result;
}

// Whether a cell beside this one is outside of the raster or unknown.
bool at_border(const Raster& raster, const Eigen::Vector2d& place) {
  const int column = raster.column_of(place.x());
  const int row = raster.row_of(place.y());
  int known = 0;
  around(raster, column, row,
         [&](std::size_t i) { known += std::isfinite(raster.values[i]) ? 1 : 0; });
  return known < 8;
}

double reach_of(double height_m) {
  namespace owners = forest_constants::tree_owners;
  return std::clamp(owners::kCrownShare * height_m + owners::kCrownOffset, owners::kLeastReach,
                    owners::kMostReach);
}

// Cells in the order in which the water, sinking from the tops, uncovers them.
class Watershed {
 public:
  Watershed(const Raster& heights, const CanopyCrownConfig& config, CanopyCrowns& crowns)
      : heights_(heights), config_(config), crowns_(crowns) {
    crowns_.owner.assign(heights.values.size(), CanopyCrowns::kNone);
  }

  void run() {
    for (std::size_t i = 0; i < crowns_.crowns.size(); ++i)
      begin(static_cast<std::int32_t>(i));
    while (!next_.empty()) {
      const auto [height, minus_order, cell] = next_.top();
      next_.pop();
      const auto column = static_cast<int>(cell % static_cast<std::size_t>(heights_.columns));
      const auto row = static_cast<int>(cell / static_cast<std::size_t>(heights_.columns));
      around(heights_, column, row, [&](std::size_t other) {
        if (crowns_.owner[other] == CanopyCrowns::kNone && belongs(other, crowns_.owner[cell]))
          take(other, crowns_.owner[cell], height);
      });
    }
    measure();
  }

 private:
  void begin(std::int32_t crown) {
    const Eigen::Vector2d& top = crowns_.crowns[static_cast<std::size_t>(crown)].top;
    const int column = std::clamp(heights_.column_of(top.x()), 0, heights_.columns - 1);
    const int row = std::clamp(heights_.row_of(top.y()), 0, heights_.rows - 1);
    const std::size_t cell = heights_.index(column, row);
    if (crowns_.owner[cell] == CanopyCrowns::kNone)
      take(cell, crown, std::numeric_limits<float>::infinity());
  }

  [[nodiscard]] bool belongs(std::size_t cell, std::int32_t crown) const {
    const CanopyCrown& of = crowns_.crowns[static_cast<std::size_t>(crown)];
    const auto height = static_cast<double>(crowns_.canopy.values[cell]);
    if (!(height >= config_.lowest_share * of.height_m)) return false;
    const auto columns = static_cast<std::size_t>(heights_.columns);
    const Eigen::Vector2d centre(
        heights_.x0 + heights_.cell_m * (static_cast<double>(cell % columns) + 0.5),
        heights_.y0 + heights_.cell_m * (static_cast<double>(cell / columns) + 0.5));
    return (centre - of.top).norm() <= reach_of(of.height_m);
  }

  // A cell behind a lower one is uncovered with that one.
  void take(std::size_t cell, std::int32_t crown, float at_most) {
    crowns_.owner[cell] = crown;
    next_.emplace(std::min(heights_.values[cell], at_most), -(order_++), cell);
  }

  // A cell counts as a crown where any of its points is one. Cells at the open edge therefore hold
  // half of what they seem to.
  void measure() {
    const double cell_m2 = heights_.cell_m * heights_.cell_m;
    for (int row = 0; row < heights_.rows; ++row) {
      for (int column = 0; column < heights_.columns; ++column) {
        const std::int32_t crown = crowns_.owner[heights_.index(column, row)];
        if (crown == CanopyCrowns::kNone) continue;
        const bool edge = is_open(column - 1, row) || is_open(column + 1, row) ||
                          is_open(column, row - 1) || is_open(column, row + 1);
        crowns_.crowns[static_cast<std::size_t>(crown)].area_m2 += (edge ? 0.5 : 1.0) * cell_m2;
      }
    }
  }

  [[nodiscard]] bool is_open(int column, int row) const {
    return heights_.contains(column, row) &&
           crowns_.owner[heights_.index(column, row)] == CanopyCrowns::kNone;
  }

  const Raster& heights_;  // smoothed: the valleys
  const CanopyCrownConfig& config_;
  CanopyCrowns& crowns_;
  std::int64_t order_ = 0;
  // The highest first; of equal ones the first taken.
  std::priority_queue<std::tuple<float, std::int64_t, std::size_t>> next_;
};

}  // namespace

void describe(ConfigTable& table, CanopyCrownConfig& config) {
  table.add_enum(
      "search", config.search,
      {{"never", CrownSearch::kNever},
       {"from_above", CrownSearch::kFromAbove},
       {"always", CrownSearch::kAlways}},
      "trees found by their crowns alone, without diameter: never; from_above: in clouds "
      "that show hardly any stem; always: wherever no stem stands below");
  table.add("smoothing_m", config.tops.smoothing_m, {0.0, 5.0}, "m",
            "standard deviation of the bell that smooths the canopy, so that a crown has one top");
  table.add("least_height_m", config.tops.least_height_m, {0.5, 50.0}, "m",
            "a lower top is no tree");
  table.add("window_m", config.tops.window_m, {0.1, 20.0}, "m",
            "a top is the highest within this radius plus window_per_m times its height");
  table.add("window_per_m", config.tops.window_per_m, {0.0, 1.0}, "", "see window_m");
  table.add("lowest_share", config.lowest_share, {0.0, 1.0}, "",
            "share of a tree's height below which the canopy is no part of its crown");
}

std::int32_t CanopyCrowns::at(const Eigen::Vector2d& place) const {
  const int column = canopy.column_of(place.x());
  const int row = canopy.row_of(place.y());
  return canopy.contains(column, row) ? owner[canopy.index(column, row)] : kNone;
}

CanopyCrowns find_canopy_crowns(const Raster& canopy, const CanopyCrownConfig& config) {
  CanopyCrowns result;
  result.canopy = filled(canopy);
  for (const CanopyTop& top : find_canopy_tops(result.canopy, config.tops))
    result.crowns.push_back({top.at, top.height_m, 0.0, at_border(result.canopy, top.at)});
  const Raster heights = smoothed_canopy(result.canopy, config.tops.smoothing_m);
  Watershed(heights, config, result).run();
  return result;
}

}  // namespace understory
