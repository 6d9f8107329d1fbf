#include "understory/forest/ground/cloth.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "understory/forest/forest_constants.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using namespace forest_constants::cloth;

constexpr std::size_t kRowGrain = 16;

class Cloth {
 public:
  Cloth(const std::vector<float>& floor, int columns, int rows)
      : floor_(floor),
        columns_(columns),
        rows_(rows),
        height_(floor.size()),
        before_(floor.size()),
        next_(floor.size()),
        held_(floor.size(), 0) {
    float lowest = std::numeric_limits<float>::max();
    for (const float z : floor_)
      lowest = std::isfinite(z) ? std::min(lowest, z) : lowest;
    std::fill(height_.begin(), height_.end(), lowest - 1.0F);
    before_ = height_;
  }

  // One step; returns the largest movement of a node.
  float step(int stiffness) {
    const std::vector<float> start = height_;
    each_row([&](int row) {
      for (int column = 0; column < columns_; ++column) {
        const std::size_t i = at(column, row);
        const float here = height_[i];
        if (held_[i] == 0) {
          next_[i] = here + kDamping * (here - before_[i]) + kFall;
        } else {
          next_[i] = here;
        }
      }
    });
    before_ = start;
    height_.swap(next_);
    for (int s = 0; s < stiffness; ++s)
      relax();
    return collide(start);
  }

  [[nodiscard]] const std::vector<float>& height() const { return height_; }

 private:
  [[nodiscard]] std::size_t at(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(column);
  }
  template <typename Body>
  void each_row(const Body& body) const {
    parallel_for(static_cast<std::size_t>(rows_), kRowGrain,
                 [&](std::size_t row) { body(static_cast<int>(row)); });
  }

  void relax() {
    each_row([&](int row) {
      for (int column = 0; column < columns_; ++column) {
        const std::size_t i = at(column, row);
        next_[i] = height_[i];
        if (held_[i] != 0) continue;
        float sum = 0.0F;
        int count = 0;
        const auto add = [&](int c, int r) {
          if (c < 0 || r < 0 || c >= columns_ || r >= rows_) return;
          sum += height_[at(c, r)];
          ++count;
        };
        add(column - 1, row);
        add(column + 1, row);
        add(column, row - 1);
        add(column, row + 1);
        if (count > 0) next_[i] += kPull * (sum / static_cast<float>(count) - height_[i]);
      }
    });
    height_.swap(next_);
  }

  float collide(const std::vector<float>& start) {
    std::vector<float> moved(static_cast<std::size_t>(rows_), 0.0F);
    each_row([&](int row) {
      for (int column = 0; column < columns_; ++column) {
        const std::size_t i = at(column, row);
        if (std::isfinite(floor_[i]) && height_[i] >= floor_[i]) {
          height_[i] = floor_[i];
          held_[i] = 1;
        }
        float& most = moved[static_cast<std::size_t>(row)];
        most = std::max(most, std::abs(height_[i] - start[i]));
      }
    });
    return rows_ == 0 ? 0.0F : *std::max_element(moved.begin(), moved.end());
  }

  const std::vector<float>& floor_;
  int columns_;
  int rows_;
  std::vector<float> height_;
  std::vector<float> before_;
  std::vector<float> next_;
  std::vector<char> held_;
};

}  // namespace

std::vector<float> settle_cloth(const std::vector<float>& floor, int columns, int rows,
                                const ClothConfig& config, const ProgressSink& progress) {
  if (std::none_of(floor.begin(), floor.end(), [](float z) { return std::isfinite(z); }))
    return floor;
  Cloth cloth(floor, columns, rows);
  for (int i = 0; i < config.steps; ++i) {
    progress.poll();
    if (cloth.step(config.stiffness) < kSettled) break;
  }
  return cloth.height();
}

}  // namespace understory
