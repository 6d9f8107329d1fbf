#include "understory/forest/search/density_peaks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <utility>

#include "understory/forest/foliage_constants.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using namespace foliage_constants;

using Cell = std::pair<int, int>;  // row, column
using CoreWeights = std::array<float, 2 * kCoreCells + 1>;

constexpr int kBorder = kAroundCells + kPeakCells + kCoreCells;
constexpr int kWidth = kBlockCells + 2 * kBorder;
constexpr std::size_t kTogether = 16;  // blocks that share their memory

// Of cells so far from the middle: a Gaussian whose middle has 1.
CoreWeights core_weights() {
  CoreWeights weights{};
  for (int i = -kCoreCells; i <= kCoreCells; ++i)
    weights[static_cast<std::size_t>(i + kCoreCells)] =
        static_cast<float>(std::exp(-0.5 * i * i / (kCoreSpread * kCoreSpread)));
  return weights;
}

// The cells of a block, with a border. One block after another lies in the same memory. To clear
// all of it for each one would take longer than the search.
class Block {
 public:
  Block() : counts_(static_cast<std::size_t>(kWidth) * kWidth, 0) {}

  // Peaks of a block without its border.
  [[nodiscard]] std::vector<DensityPeak> peaks(const Cell& block, const std::vector<Cell>& points) {
    fill(block, points);
    const std::vector<Cell> dense = dense_cells();
    std::vector<DensityPeak> peaks;
    if (!dense.empty()) peaks = peaks_among(dense);  // most blocks far from the path have none
    for (const auto& [r, c] : dense)
      core_[at(r, c)] = 0.0F;
    for (const auto& [r, c] : occupied_)
      counts_[at(r, c)] = 0;
    return peaks;
  }

 private:
  void fill(const Cell& block, const std::vector<Cell>& points) {
    row0_ = block.first * kBlockCells - kBorder;
    column0_ = block.second * kBlockCells - kBorder;
    occupied_.clear();
    for (const auto& [row, column] : points) {
      const Cell cell{row - row0_, column - column0_};
      if (counts_[at(cell.first, cell.second)]++ == 0) occupied_.push_back(cell);
    }
    std::sort(occupied_.begin(), occupied_.end());
  }

  [[nodiscard]] std::vector<DensityPeak> peaks_among(const std::vector<Cell>& dense) {
    std::vector<DensityPeak> peaks;
    sum_up();
    for (const auto& [r, c] : dense) {
      if (!is_within(r) || !is_within(c) || !is_highest(r, c)) continue;
      const double around = around_of(r, c);
      const double contrast =
          (static_cast<double>(core_[at(r, c)]) - around) / std::sqrt(around + 1.0);
      if (contrast >= kLeastContrast) peaks.push_back({mean_place(r, c), contrast});
    }
    return peaks;
  }

  static bool is_within(int i) { return i >= kBorder && i < kWidth - kBorder; }
  static std::size_t at(int r, int c) {
    return static_cast<std::size_t>(r) * kWidth + static_cast<std::size_t>(c);
  }
  static std::size_t sum_at(int r, int c) {
    return static_cast<std::size_t>(r) * (kWidth + 1) + static_cast<std::size_t>(c);
  }

  // Cells whose cores hold enough points, by rows; fills in the cores.
  [[nodiscard]] std::vector<Cell> dense_cells() {
    const CoreWeights weights = core_weights();
    constexpr int kFrom = kBorder - kPeakCells;
    std::vector<Cell> dense;
    for (const auto& [r, c] : occupied_) {
      if (r < kFrom || c < kFrom || r >= kWidth - kFrom || c >= kWidth - kFrom) continue;
      const float core = core_of(r, c, weights);
      if (core < kLeastCore) continue;
      if (core_.empty()) core_.resize(counts_.size(), 0.0F);
      core_[at(r, c)] = core;
      dense.emplace_back(r, c);
    }
    return dense;
  }

  // Sums over all cells of lower rows and columns.
  void sum_up() {
    sums_.resize(static_cast<std::size_t>(kWidth + 1) * (kWidth + 1), 0);
    for (int r = 0; r < kWidth; ++r) {
      std::uint32_t row = 0;
      for (int c = 0; c < kWidth; ++c) {
        row += counts_[at(r, c)];
        sums_[sum_at(r + 1, c + 1)] = sums_[sum_at(r, c + 1)] + row;
      }
    }
  }

  [[nodiscard]] float core_of(int r, int c, const CoreWeights& weights) const {
    float sum = 0.0F;
    for (int i = -kCoreCells; i <= kCoreCells; ++i) {
      float row = 0.0F;
      for (int j = -kCoreCells; j <= kCoreCells; ++j)
        row += weights[static_cast<std::size_t>(j + kCoreCells)] *
               static_cast<float>(counts_[at(r + i, c + j)]);
      sum += weights[static_cast<std::size_t>(i + kCoreCells)] * row;
    }
    return sum;
  }

  // Points that a core would have if those of the square around it lay evenly.
  [[nodiscard]] double around_of(int r, int c) const {
    const auto sum = [&](int row, int column) {
      return static_cast<double>(sums_[sum_at(row, column)]);
    };
    constexpr int kSide = 2 * kAroundCells + 1;
    const int r0 = r - kAroundCells;
    const int c0 = c - kAroundCells;
    const double points =
        sum(r0 + kSide, c0 + kSide) - sum(r0, c0 + kSide) - sum(r0 + kSide, c0) + sum(r0, c0);
    return points / (kSide * kSide) * 2.0 * M_PI * kCoreSpread * kCoreSpread;
  }

  // Of two alike the first one counts.
  [[nodiscard]] bool is_highest(int r, int c) const {
    const float own = core_[at(r, c)];
    for (int i = -kPeakCells; i <= kPeakCells; ++i) {
      for (int j = -kPeakCells; j <= kPeakCells; ++j) {
        const float other = core_[at(r + i, c + j)];
        const bool before = i < 0 || (i == 0 && j < 0);
        if (other > own || (before && other == own)) return false;
      }
    }
    return true;
  }

  [[nodiscard]] Eigen::Vector2d mean_place(int r, int c) const {
    double points = 0.0;
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (int i = -kPeakCells; i <= kPeakCells; ++i) {
      for (int j = -kPeakCells; j <= kPeakCells; ++j) {
        const auto count = static_cast<double>(counts_[at(r + i, c + j)]);
        points += count;
        sum += count * Eigen::Vector2d(column0_ + c + j + 0.5, row0_ + r + i + 0.5);
      }
    }
    return kCellM / points * sum;
  }

  int row0_ = 0;
  int column0_ = 0;
  std::vector<std::uint32_t> counts_;
  std::vector<Cell> occupied_;
  std::vector<std::uint32_t> sums_;
  std::vector<float> core_;
};

int cell_of(float value) {
  return static_cast<int>(std::floor(static_cast<double>(value) / kCellM));
}

int block_of(int cell) {
  return static_cast<int>(std::floor(static_cast<double>(cell) / kBlockCells));
}

// The occupied cells by block. One near the border of a block is in its neighbours, too.
std::map<Cell, std::vector<Cell>> blocks_of(const std::vector<Eigen::Vector2f>& points) {
  std::map<Cell, std::vector<Cell>> blocks;
  for (const Eigen::Vector2f& point : points) {
    const Cell cell{cell_of(point.y()), cell_of(point.x())};
    const int last_row = block_of(cell.first + kBorder);
    const int last_column = block_of(cell.second + kBorder);
    for (int r = block_of(cell.first - kBorder); r <= last_row; ++r) {
      for (int c = block_of(cell.second - kBorder); c <= last_column; ++c)
        blocks[{r, c}].push_back(cell);
    }
  }
  return blocks;
}

}  // namespace

std::vector<DensityPeak> find_density_peaks(const std::vector<Eigen::Vector2f>& points,
                                            const ProgressSink& progress) {
  const std::map<Cell, std::vector<Cell>> blocks = blocks_of(points);
  std::vector<const std::pair<const Cell, std::vector<Cell>>*> filled;
  for (const auto& block : blocks) {
    if (block.second.size() >= kFewestPoints) filled.push_back(&block);
  }
  std::vector<std::vector<DensityPeak>> found(filled.size());
  parallel_for((filled.size() + kTogether - 1) / kTogether, 1, [&](std::size_t group) {
    Block block;
    const std::size_t end = std::min(filled.size(), (group + 1) * kTogether);
    for (std::size_t i = group * kTogether; i < end; ++i) {
      progress.poll();
      found[i] = block.peaks(filled[i]->first, filled[i]->second);
    }
  });
  std::vector<DensityPeak> peaks;
  for (const std::vector<DensityPeak>& part : found)
    peaks.insert(peaks.end(), part.begin(), part.end());
  return peaks;
}

}  // namespace understory
