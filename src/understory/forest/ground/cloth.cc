#include "understory/forest/ground/cloth.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
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
    each_row([&](int row) {
      for (std::size_t i = at(0, row); i < at(0, row + 1); ++i) {
        const float here = height_[i];
        const float fallen = here + kDamping * (here - before_[i]) + kFall;
        next_[i] = held_[i] == 0 ? fallen : here;
      }
    });
    before_.swap(height_);
    height_.swap(next_);
    for (int s = 0; s < stiffness; ++s)
      relax();
    return collide();
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

  // A node pulled towards the mean of the four around it, or of those that there are.
  [[nodiscard]] float pulled(int column, int row) const {
    const float here = height_[at(column, row)];
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
    return count == 0 ? here : here + kPull * (sum / static_cast<float>(count) - here);
  }

  void relax_node(int column, int row) {
    const std::size_t i = at(column, row);
    next_[i] = held_[i] == 0 ? pulled(column, row) : height_[i];
  }

  // Nodes with all four neighbours: without a question for each, the compiler makes vectors of it.
  void relax_inner(int row) {
    const float* here = height_.data() + at(0, row);
    const float* south = here - columns_;
    const float* north = here + columns_;
    const std::uint32_t* held = held_.data() + at(0, row);
    float* next = next_.data() + at(0, row);
    for (int c = 1; c + 1 < columns_; ++c) {
      const float sum = here[c - 1] + here[c + 1] + south[c] + north[c];
      const float free = here[c] + kPull * (sum / 4.0F - here[c]);
      next[c] = held[c] == 0 ? free : here[c];
    }
  }

  void relax() {
    each_row([&](int row) {
      if (row == 0 || row + 1 == rows_) {
        for (int column = 0; column < columns_; ++column)
          relax_node(column, row);
        return;
      }
      relax_node(0, row);
      relax_inner(row);
      relax_node(columns_ - 1, row);
    });
    height_.swap(next_);
  }

  // Nodes on the floor stay there. Returns the largest movement since the step began.
  float collide() {
    std::vector<float> moved(static_cast<std::size_t>(rows_), 0.0F);
    each_row([&](int row) {
      float most = 0.0F;
      for (std::size_t i = at(0, row); i < at(0, row + 1); ++i) {
        // False where the floor is unknown.
        const bool touches = height_[i] >= floor_[i];
        height_[i] = touches ? floor_[i] : height_[i];
        held_[i] = touches ? 1 : held_[i];
        most = std::max(most, std::abs(height_[i] - before_[i]));
      }
      moved[static_cast<std::size_t>(row)] = most;
    });
    return rows_ == 0 ? 0.0F : *std::max_element(moved.begin(), moved.end());
  }

  const std::vector<float>& floor_;
  int columns_;
  int rows_;
  std::vector<float> height_;
  std::vector<float> before_;  // heights when the step began
  std::vector<float> next_;
  std::vector<std::uint32_t> held_;  // as wide as a height, for the compiler's vectors
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
