#include "understory/graph/self_correction/blur_change.h"

#include <algorithm>
#include <array>
#include <bitset>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

#include "understory/graph/graph_constants.h"
#include "understory/util/error.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using namespace graph_constants::blur_change;

// Cells along a side of the bitmap of one part. Cells that lie this many apart share a bit; points
// of one part lie nearer to each other.
constexpr int kSide = 128;

using Cells = std::bitset<static_cast<std::size_t>(kSide) * kSide>;

// Fine cells of the points [begin, end) of `order`, on grid number `grid`. The grids are spread
// over a cell by the fractions of the plastic number (Roberts' R2 sequence).
std::size_t fine_cells(const SparsePoints& map, const std::vector<std::uint32_t>& order,
                       std::pair<std::size_t, std::size_t> part, double fine_m, int grid) {
  const double shift_x = std::fmod(0.7548776662466927 * grid, 1.0);
  const double shift_y = std::fmod(0.5698402909980532 * grid, 1.0);
  Cells cells;
  for (std::size_t k = part.first; k < part.second; ++k) {
    const Eigen::Vector3d& point = map[order[k]];
    const auto x = static_cast<std::int64_t>(std::floor(point.x() / fine_m + shift_x));
    const auto y = static_cast<std::int64_t>(std::floor(point.y() / fine_m + shift_y));
    cells.set(static_cast<std::size_t>((y & (kSide - 1)) * kSide + (x & (kSide - 1))));
  }
  return cells.count();
}

// The points by the coarse cell that they lie in, half way between both maps. Sights of a tree on
// the border of two parts then split alike in both. And where in that order each cell begins.
struct Parts {
  std::vector<std::uint32_t> order;
  std::vector<std::size_t> begin;
};

Parts parts_of(const SparsePoints& before, const SparsePoints& after, double coarse_m) {
  std::vector<std::pair<std::int64_t, std::int64_t>> cell(before.size());
  for (std::size_t i = 0; i < before.size(); ++i) {
    const Eigen::Vector3d middle = 0.5 * (before[i] + after[i]);
    cell[i] = {static_cast<std::int64_t>(std::floor(middle.x() / coarse_m)),
               static_cast<std::int64_t>(std::floor(middle.y() / coarse_m))};
  }
  Parts parts;
  parts.order.resize(before.size());
  std::iota(parts.order.begin(), parts.order.end(), 0U);
  std::sort(parts.order.begin(), parts.order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return cell[a] != cell[b] ? cell[a] < cell[b] : a < b;
  });
  for (std::size_t k = 0; k < parts.order.size(); ++k) {
    if (k == 0 || cell[parts.order[k]] != cell[parts.order[k - 1]]) parts.begin.push_back(k);
  }
  parts.begin.push_back(parts.order.size());
  return parts;
}

}  // namespace

BlurChange blur_change(const SparsePoints& before, const SparsePoints& after,
                       const SharpnessConfig& config) {
  UNDERSTORY_CHECK(before.size() == after.size());
  if (before.empty()) return {};
  const Parts parts = parts_of(before, after, config.coarse_m);
  const std::size_t count = parts.begin.size() - 1;
  std::vector<std::array<double, 2>> cells(count);
  parallel_for(count, 16, [&](std::size_t p) {
    const std::pair part(parts.begin[p], parts.begin[p + 1]);
    for (int grid = 0; grid < kGrids; ++grid) {
      cells[p][0] +=
          static_cast<double>(fine_cells(before, parts.order, part, config.fine_m, grid));
      cells[p][1] += static_cast<double>(fine_cells(after, parts.order, part, config.fine_m, grid));
    }
  });
  double sum_before = 0.0;
  double change = 0.0;
  double squares = 0.0;
  for (const auto& [cells_before, cells_after] : cells) {
    sum_before += cells_before;
    change += cells_after - cells_before;
    squares += (cells_after - cells_before) * (cells_after - cells_before);
  }
  BlurChange result;
  result.ratio = 1.0 + change / sum_before;
  if (squares > 0.0) result.deviations = change / std::sqrt(squares);
  return result;
}

}  // namespace understory
