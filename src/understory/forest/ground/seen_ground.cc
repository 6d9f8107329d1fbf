#include "understory/forest/ground/seen_ground.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>
#include <optional>
#include <vector>

#include "understory/forest/forest_constants.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using namespace forest_constants::seen_ground;

constexpr std::size_t kRowGrain = 16;

// Sums over cells around a place, whose own offset is zero: for a plane through them.
struct Sums {
  double n = 0.0, x = 0.0, y = 0.0, z = 0.0;
  double xx = 0.0, xy = 0.0, yy = 0.0, xz = 0.0, yz = 0.0;
  void add(double at_x, double at_y, double height) {
    n += 1.0;
    x += at_x;
    y += at_y;
    z += height;
    xx += at_x * at_x;
    xy += at_x * at_y;
    yy += at_y * at_y;
    xz += at_x * height;
    yz += at_y * height;
  }
};

struct Slope {
  double x = 0.0;
  double y = 0.0;
};

// Gradient of the plane, metres a cell, drawn to `prior` as by `ridge` square cells.
Slope slope_of(const Sums& sums, double ridge, const Slope& prior) {
  const double a = sums.xx / sums.n - sums.x * sums.x / (sums.n * sums.n) + ridge;
  const double b = sums.yy / sums.n - sums.y * sums.y / (sums.n * sums.n) + ridge;
  const double c = sums.xy / sums.n - sums.x * sums.y / (sums.n * sums.n);
  const double u = sums.xz / sums.n - sums.x * sums.z / (sums.n * sums.n) + ridge * prior.x;
  const double v = sums.yz / sums.n - sums.y * sums.z / (sums.n * sums.n) + ridge * prior.y;
  const double d = a * b - c * c;
  return {(u * b - v * c) / d, (a * v - c * u) / d};
}

class SeenGround {
 public:
  explicit SeenGround(Raster& ground) : ground_(ground), taken_(ground.values.size(), 0) {}

  void decide() {
    find_sure();
    for (int round = 0; round < kMostRounds && !open_.empty(); ++round) {
      if (!grow()) break;
    }
    for (std::size_t i = 0; i < taken_.size(); ++i) {
      if (taken_[i] == 0) ground_.values[i] = std::numeric_limits<float>::quiet_NaN();
    }
  }

 private:
  // Of the cells around, those that the cloth touched; -1 where this one is not.
  [[nodiscard]] float share_around(int column, int row) const {
    if (!std::isfinite(ground_.values[ground_.index(column, row)])) return -1.0F;
    int touched = 0;
    int all = 0;
    for (int j = -kShareReach; j <= kShareReach; ++j) {
      for (int i = -kShareReach; i <= kShareReach; ++i) {
        if (!ground_.contains(column + i, row + j)) continue;
        ++all;
        touched += std::isfinite(ground_.values[ground_.index(column + i, row + j)]) ? 1 : 0;
      }
    }
    return static_cast<float>(touched) / static_cast<float>(all);
  }

  void find_sure() {
    std::vector<float> shares(ground_.values.size());
    parallel_for(static_cast<std::size_t>(ground_.rows), kRowGrain, [&](std::size_t row) {
      for (int column = 0; column < ground_.columns; ++column)
        shares[ground_.index(column, static_cast<int>(row))] =
            share_around(column, static_cast<int>(row));
    });
    std::vector<float> known;
    std::copy_if(shares.begin(), shares.end(), std::back_inserter(known),
                 [](float share) { return share >= 0.0F; });
    if (known.empty()) return;
    const auto middle = known.begin() + static_cast<std::ptrdiff_t>(known.size() / 2);
    std::nth_element(known.begin(), middle, known.end());
    const float least = kSureShare * *middle;
    for (std::size_t i = 0; i < shares.size(); ++i) {
      if (shares[i] < 0.0F) continue;
      if (shares[i] >= least)
        taken_[i] = 1;
      else
        open_.push_back(i);
    }
  }

  [[nodiscard]] Sums sums_around(int column, int row, int reach, int step) const {
    Sums sums;
    for (int j = -reach; j <= reach; j += step) {
      for (int i = -reach; i <= reach; i += step) {
        if (!ground_.contains(column + i, row + j)) continue;
        const std::size_t at = ground_.index(column + i, row + j);
        if (taken_[at] != 0) sums.add(i, j, static_cast<double>(ground_.values[at]));
      }
    }
    return sums;
  }

  // Cells to the nearest ground, of those within half of the plane's reach.
  [[nodiscard]] std::optional<double> nearest(int column, int row) const {
    std::optional<double> squared;
    for (int j = -kPlaneReach / 2; j <= kPlaneReach / 2; ++j) {
      for (int i = -kPlaneReach / 2; i <= kPlaneReach / 2; ++i) {
        if (!ground_.contains(column + i, row + j)) continue;
        if (taken_[ground_.index(column + i, row + j)] == 0) continue;
        const double here = i * i + j * j;
        if (!squared || here < *squared) squared = here;
      }
    }
    return squared ? std::optional(std::sqrt(*squared)) : std::nullopt;
  }

  [[nodiscard]] bool is_ground(std::size_t at) const {
    const int row = static_cast<int>(at / static_cast<std::size_t>(ground_.columns));
    const int column = static_cast<int>(at % static_cast<std::size_t>(ground_.columns));
    const std::optional<double> away = nearest(column, row);
    if (!away) return false;
    const Sums near = sums_around(column, row, kPlaneReach, 1);
    if (near.n < kLeastCells) return false;
    const Sums far = sums_around(column, row, kSlopeReach, 2);
    const Slope wide = far.n > kLeastCells ? slope_of(far, kSlopeRidge, {}) : Slope{};
    const Slope slope = slope_of(near, kPlaneRidge, wide);
    const double plane = (near.z - slope.x * near.x - slope.y * near.y) / near.n;
    const double above = static_cast<double>(ground_.values[at]) - plane;
    return above < kAbove + kAbovePerMetre * *away * ground_.cell_m;
  }

  // Takes what is ground beside the ground so far. False if there is no more.
  bool grow() {
    std::vector<std::uint8_t> more(open_.size(), 0);
    parallel_for(open_.size(), 64, [&](std::size_t i) { more[i] = is_ground(open_[i]) ? 1 : 0; });
    std::vector<std::size_t> left;
    for (std::size_t i = 0; i < open_.size(); ++i) {
      if (more[i] != 0)
        taken_[open_[i]] = 1;
      else
        left.push_back(open_[i]);
    }
    const bool grew = left.size() < open_.size();
    open_.swap(left);
    return grew;
  }

  Raster& ground_;
  std::vector<std::uint8_t> taken_;  // surely ground, or decided to be
  std::vector<std::size_t> open_;    // touched by the cloth, not decided
};

}  // namespace

void drop_unseen_ground(Raster& ground) {
  SeenGround(ground).decide();
}

}  // namespace understory
