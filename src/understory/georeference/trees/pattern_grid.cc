#include "understory/georeference/trees/pattern_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "understory/georeference/georeference_constants.h"

namespace understory {
namespace {

using namespace georeference_constants::tree_match;

// One pass of a Gaussian along lines of `n` values that lie `step` apart.
void smooth_line(const float* from, float* to, int n, int step, const std::vector<float>& weights) {
  const int reach = static_cast<int>(weights.size()) - 1;
  for (int i = 0; i < n; ++i) {
    float sum = weights[0] * from[i * step];
    for (int k = 1; k <= reach; ++k) {
      if (i - k >= 0) sum += weights[static_cast<std::size_t>(k)] * from[(i - k) * step];
      if (i + k < n) sum += weights[static_cast<std::size_t>(k)] * from[(i + k) * step];
    }
    to[i * step] = sum;
  }
}

void smooth(std::vector<float>& values, int columns, int rows, double sd_cells) {
  std::vector<float> weights;
  double sum = 0.0;
  for (int k = 0; k <= static_cast<int>(3.0 * sd_cells); ++k) {
    weights.push_back(static_cast<float>(std::exp(-0.5 * k * k / (sd_cells * sd_cells))));
    sum += (k == 0 ? 1.0 : 2.0) * weights.back();
  }
  for (float& weight : weights)
    weight /= static_cast<float>(sum);
  std::vector<float> half(values.size());
  for (int row = 0; row < rows; ++row)
    smooth_line(&values[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns)],
                &half[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns)], columns,
                1, weights);
  for (int column = 0; column < columns; ++column)
    smooth_line(&half[static_cast<std::size_t>(column)], &values[static_cast<std::size_t>(column)],
                rows, columns, weights);
}

// Cells within `reach` cells of a cell that holds 1.
std::vector<float> spread(const std::vector<float>& cells, int columns, int rows, double reach) {
  std::vector<float> result(cells.size(), 0.0F);
  const int whole = static_cast<int>(reach);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      if (cells[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
                static_cast<std::size_t>(column)] == 0.0F)
        continue;
      for (int r = std::max(0, row - whole); r <= std::min(rows - 1, row + whole); ++r) {
        const double left = reach * reach - static_cast<double>((r - row) * (r - row));
        const int half = static_cast<int>(std::sqrt(std::max(0.0, left)));
        const std::size_t line = static_cast<std::size_t>(r) * static_cast<std::size_t>(columns);
        const int from = std::max(0, column - half);
        const int to = std::min(columns - 1, column + half);
        std::fill(result.begin() + static_cast<std::ptrdiff_t>(line) + from,
                  result.begin() + static_cast<std::ptrdiff_t>(line) + to + 1, 1.0F);
      }
    }
  }
  return result;
}

}  // namespace

PatternGrid::PatternGrid(std::vector<PatternTree> trees, const SeenArea& seen) {
  cell_m_ = seen.cell_m;
  Eigen::Vector2d high = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < trees.size(); ++i) {
    low_ = i == 0 ? trees[i].at : low_.cwiseMin(trees[i].at);
    high = i == 0 ? trees[i].at : high.cwiseMax(trees[i].at);
  }
  // The area seen lies around the trees.
  low_.array() -= seen.reach_m + cell_m_;
  high.array() += seen.reach_m + cell_m_;
  const Eigen::Vector2d size = high - low_;
  // No more than four million cells, however far apart the trees are.
  cell_m_ = std::max({cell_m_, size.x() / kMostGridCells, size.y() / kMostGridCells});
  columns_ = static_cast<int>(size.x() / cell_m_) + 1;
  rows_ = static_cast<int>(size.y() / cell_m_) + 1;
  sort_into_cells(trees);
  measure_density(seen);
}

void PatternGrid::sort_into_cells(const std::vector<PatternTree>& given) {
  const auto cell_of = [&](const PatternTree& tree) {
    const Eigen::Vector2d at = tree.at - low_;
    return static_cast<std::size_t>(clamped(at.y(), rows_)) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(clamped(at.x(), columns_));
  };
  first_.assign(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_) + 1, 0);
  for (const PatternTree& tree : given)
    ++first_[cell_of(tree) + 1];
  for (std::size_t cell = 1; cell < first_.size(); ++cell)
    first_[cell] += first_[cell - 1];
  std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
  trees_.resize(given.size());
  given_.resize(given.size());
  for (std::size_t i = 0; i < given.size(); ++i) {
    const std::uint32_t place = next[cell_of(given[i])]++;
    trees_[place] = given[i];
    given_[place] = i;
  }
}

std::vector<float> PatternGrid::seen_cells(const SeenArea& seen) const {
  std::vector<float> cells(first_.size() - 1);
  for (std::size_t cell = 0; cell < cells.size(); ++cell)
    cells[cell] = first_[cell + 1] > first_[cell] ? 1.0F : 0.0F;
  cells = spread(cells, columns_, rows_, seen.reach_m / cell_m_);
  if (seen.shrink_m <= 0.0) return cells;
  for (float& cell : cells)
    cell = 1.0F - cell;
  cells = spread(cells, columns_, rows_, seen.shrink_m / cell_m_);
  for (float& cell : cells)
    cell = 1.0F - cell;
  return cells;
}

void PatternGrid::measure_density(const SeenArea& seen) {
  const std::size_t cells = first_.size() - 1;
  density_.assign(cells, 0.0F);
  for (std::size_t cell = 0; cell < cells; ++cell)
    density_[cell] = static_cast<float>((first_[cell + 1] - first_[cell]) / (cell_m_ * cell_m_));
  const std::vector<float> reached = seen_cells(seen);
  smooth(density_, columns_, rows_, std::max(0.5, kDensitySdM / cell_m_));
  std::vector<float> area = reached;  // so that the edge of the map does not look thin
  smooth(area, columns_, rows_, std::max(0.5, kDensitySdM / cell_m_));
  std::vector<float> of_trees;
  for (std::size_t cell = 0; cell < cells; ++cell) {
    density_[cell] = reached[cell] > 0.0F ? density_[cell] / std::max(0.1F, area[cell]) : 0.0F;
    of_trees.insert(of_trees.end(), first_[cell + 1] - first_[cell], density_[cell]);
  }
  if (of_trees.empty()) return;
  const auto middle = of_trees.begin() + static_cast<std::ptrdiff_t>(of_trees.size() / 2);
  std::nth_element(of_trees.begin(), middle, of_trees.end());
  median_density_ = static_cast<double>(*middle);
  const auto least = static_cast<float>(kLeastDensityShare * median_density_);
  for (std::size_t cell = 0; cell < cells; ++cell)
    if (density_[cell] > 0.0F) density_[cell] = std::max(least, density_[cell]);
}

double PatternGrid::density(const Eigen::Vector2d& at) const {
  const Eigen::Vector2d cell = (at - low_) / cell_m_;
  if (!(cell.x() >= 0.0 && cell.y() >= 0.0 && cell.x() < columns_ && cell.y() < rows_)) return 0.0;
  return static_cast<double>(
      density_[static_cast<std::size_t>(cell.y()) * static_cast<std::size_t>(columns_) +
               static_cast<std::size_t>(cell.x())]);
}

double normal_quantile(double share) {
  constexpr std::array<double, 6> kA{-3.969683028665376e+01, 2.209460984245205e+02,
                                     -2.759285104469687e+02, 1.383577518672690e+02,
                                     -3.066479806614716e+01, 2.506628277459239e+00};
  constexpr std::array<double, 5> kB{-5.447609879822406e+01, 1.615858368580409e+02,
                                     -1.556989798598866e+02, 6.680131188771972e+01,
                                     -1.328068155288572e+01};
  constexpr std::array<double, 6> kC{-7.784894002430293e-03, -3.223964580411365e-01,
                                     -2.400758277161838e+00, -2.549732539343734e+00,
                                     4.374664141464968e+00,  2.938163982698783e+00};
  constexpr std::array<double, 4> kD{7.784695709041462e-03, 3.224671290700398e-01,
                                     2.445134137142996e+00, 3.754408661907416e+00};
  constexpr double kTail = 0.02425;
  if (share > 0.5) return -normal_quantile(1.0 - share);
  if (share < kTail) {
    const double q = std::sqrt(-2.0 * std::log(share));
    return (((((kC[0] * q + kC[1]) * q + kC[2]) * q + kC[3]) * q + kC[4]) * q + kC[5]) /
           ((((kD[0] * q + kD[1]) * q + kD[2]) * q + kD[3]) * q + 1.0);
  }
  const double q = share - 0.5;
  const double r = q * q;
  return (((((kA[0] * r + kA[1]) * r + kA[2]) * r + kA[3]) * r + kA[4]) * r + kA[5]) * q /
         (((((kB[0] * r + kB[1]) * r + kB[2]) * r + kB[3]) * r + kB[4]) * r + 1.0);
}

std::vector<double> local_ranks(const std::vector<Eigen::Vector2d>& places,
                                const std::vector<double>& sizes, double radius_m) {
  std::vector<PatternTree> trees;
  for (std::size_t i = 0; i < places.size(); ++i)
    trees.push_back({places[i], sizes[i]});
  const PatternGrid grid(std::move(trees));
  std::vector<double> ranks(places.size(), std::numeric_limits<double>::quiet_NaN());
  constexpr int kLeastNeighbours = 5;
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (!std::isfinite(sizes[i])) continue;
    double below = 0.0;
    int known = 0;
    grid.near(places[i], radius_m, [&](std::size_t k, double) {
      const double other = grid.trees()[k].rank;
      if (!std::isfinite(other)) return;
      below += other < sizes[i] ? 1.0 : other == sizes[i] ? 0.5 : 0.0;
      ++known;
    });
    // The tree itself is among those counted, as half below.
    if (known > kLeastNeighbours) ranks[i] = normal_quantile(below / known);
  }
  return ranks;
}

}  // namespace understory
