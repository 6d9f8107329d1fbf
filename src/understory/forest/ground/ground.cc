#include "understory/forest/ground/ground.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "understory/forest/cell_grid.h"
#include "understory/forest/forest_constants.h"
#include "understory/forest/ground/cloth.h"
#include "understory/forest/ground/low_noise.h"
#include "understory/forest/ground/seen_ground.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using namespace forest_constants::ground;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// The lowest heights in a cell, in ascending order.
struct LowCell {
  std::array<float, 4> z = {kNan, kNan, kNan, kNan};
  void add(float height) {
    for (float& kept : z) {
      if (!(kept <= height)) std::swap(kept, height);
      if (std::isnan(height)) return;
    }
  }
};

// Sums are whole numbers, so that the order of points changes nothing.
struct MeanCell {
  static constexpr double kParts = 1LL << 36;  // of a metre: 60 million points of 2 m have room
  std::int64_t sum = 0;
  std::uint32_t count = 0;
  [[nodiscard]] double mean() const { return static_cast<double>(sum) / kParts / count; }
};

// The lowest point of a cell that another one lies near above; the lowest if there is none.
float supported_height(const LowCell& cell) {
  for (std::size_t i = 0; i + 1 < cell.z.size(); ++i) {
    if (cell.z[i + 1] - cell.z[i] <= kNear) return cell.z[i];
  }
  return cell.z[0];
}

// The lowest height of each cell that is no stray point below the ground: one far under its
// neighbours gives way to the next.
std::vector<float> floor_heights(const Raster& grid, const std::vector<LowCell>& low) {
  std::vector<float> supported(low.size());
  std::transform(low.begin(), low.end(), supported.begin(), supported_height);
  std::vector<float> result(low.size(), kNan);
  for (int row = 0; row < grid.rows; ++row) {
    for (int column = 0; column < grid.columns; ++column) {
      std::vector<float> around;
      for (int j = -2; j <= 2; ++j) {
        for (int i = -2; i <= 2; ++i) {
          if ((i == 0 && j == 0) || !grid.contains(column + i, row + j)) continue;
          const float z = supported[grid.index(column + i, row + j)];
          if (std::isfinite(z)) around.push_back(z);
        }
      }
      const std::size_t here = grid.index(column, row);
      float chosen = supported[here];
      if (around.size() >= 4) {
        // The third lowest around: a slope has lower neighbours, a stray point has none.
        std::nth_element(around.begin(), around.begin() + 2, around.end());
        const float floor = around[2] - kStrayDepth;
        for (const float z : low[here].z) {
          if (z < supported[here]) continue;
          chosen = z;
          if (std::isnan(z) || z >= floor) break;
        }
      }
      result[here] = chosen;
    }
  }
  return result;
}

// 1 for the cells at most `rings` cells away from a known one, also across corners.
std::vector<char> cells_around_known(const Raster& grid, int rings) {
  std::vector<char> beside(grid.values.size(), 0);
  std::vector<char> around(grid.values.size(), 0);
  // Along a line of cells: marks those that have a marked one so near before or behind them.
  const auto spread = [rings](int count, const auto& marked, const auto& mark) {
    for (const int step : {1, -1}) {
      int since = rings + 1;
      for (int i = step > 0 ? 0 : count - 1; i >= 0 && i < count; i += step) {
        since = marked(i) ? 0 : since + 1;
        if (since <= rings) mark(i);
      }
    }
  };
  for (int row = 0; row < grid.rows; ++row) {
    spread(
        grid.columns,
        [&](int column) { return std::isfinite(grid.values[grid.index(column, row)]); },
        [&](int column) { beside[grid.index(column, row)] = 1; });
  }
  for (int column = 0; column < grid.columns; ++column) {
    spread(
        grid.rows, [&](int row) { return beside[grid.index(column, row)] != 0; },
        [&](int row) { around[grid.index(column, row)] = 1; });
  }
  return around;
}

// Mean of known heights, weighted.
struct HeightMean {
  float sum = 0.0F;
  float weights = 0.0F;

  void add(float z, float weight) {
    const float counts = std::isfinite(z) ? weight : 0.0F;
    sum += std::isfinite(z) ? weight * z : 0.0F;
    weights += counts;
  }
  [[nodiscard]] float value() const { return weights > 0.0F ? sum / weights : kNan; }
};

// Mean of the eight neighbours of a cell, weighted by distance; NaN if none of them is known.
float mean_around(const Raster& grid, std::size_t cell) {
  const auto width = static_cast<std::ptrdiff_t>(grid.columns);
  const int row = static_cast<int>(cell / static_cast<std::size_t>(grid.columns));
  const int column = static_cast<int>(cell % static_cast<std::size_t>(grid.columns));
  const bool inner = column > 0 && row > 0 && column + 1 < grid.columns && row + 1 < grid.rows;
  const float* here = grid.values.data() + cell;
  HeightMean mean;
  for (int j = -1; j <= 1; ++j) {
    for (int i = -1; i <= 1; ++i) {
      if ((i == 0 && j == 0) || !(inner || grid.contains(column + i, row + j))) continue;
      mean.add(here[j * width + i], i == 0 || j == 0 ? 1.0F : 0.5F);
    }
  }
  return mean.value();
}

// Heights of the `wanted` cells from the known ones around, ring by ring until none is left. Then a
// light smoothing of the filled cells only, for gaps of `rings` cells. `no_higher`: the lowest
// return of cells that have no ground, NaN elsewhere.
void fill_gaps(Raster& grid, int rings, const std::vector<char>& wanted,
               const std::vector<float>& no_higher) {
  std::vector<std::size_t> unknown;
  for (std::size_t i = 0; i < wanted.size(); ++i)
    if (wanted[i] != 0 && !std::isfinite(grid.values[i])) unknown.push_back(i);
  std::vector<float> next(unknown.size());
  // All cells at once: none sees what another one has become.
  const auto sweep = [&](const std::vector<std::size_t>& cells) {
    parallel_for(cells.size(), 4096, [&](std::size_t k) {
      next[k] = mean_around(grid, cells[k]);
      const float most = no_higher[cells[k]];
      if (next[k] > most) next[k] = most;  // not where either is unknown
    });
    for (std::size_t k = 0; k < cells.size(); ++k)
      grid.values[cells[k]] = next[k];
  };
  std::vector<std::size_t> filled;
  while (!unknown.empty()) {
    sweep(unknown);
    const std::size_t before = unknown.size();
    std::erase_if(unknown, [&](std::size_t i) {
      if (!std::isfinite(grid.values[i])) return false;
      filled.push_back(i);
      return true;
    });
    if (unknown.size() == before) break;
  }
  for (int i = 0; i < 4 * rings; ++i)
    sweep(filled);
}

// Drops ground heights above the plane through their neighbours, such as a stump or a low branch
// that the cloth touched. The planes are robust and local, over 5 x 5 cells.
void drop_bumps(Raster& grid, float most) {
  const std::vector<float> values = grid.values;
  parallel_for(static_cast<std::size_t>(grid.rows), 16, [&](std::size_t r) {
    const int row = static_cast<int>(r);
    for (int column = 0; column < grid.columns; ++column) {
      const float here = values[grid.index(column, row)];
      if (!std::isfinite(here)) continue;
      // Opposite neighbours cancel the slope: the median of their means is the plane's height.
      std::array<float, 12> means{};
      std::size_t count = 0;
      for (int j = 0; j <= 2; ++j) {
        for (int i = (j == 0 ? 1 : -2); i <= 2; ++i) {
          if (!grid.contains(column + i, row + j) || !grid.contains(column - i, row - j)) continue;
          const float a = values[grid.index(column + i, row + j)];
          const float b = values[grid.index(column - i, row - j)];
          if (std::isfinite(a) && std::isfinite(b)) means[count++] = 0.5F * (a + b);
        }
      }
      if (count < 3) continue;
      std::nth_element(means.begin(), means.begin() + static_cast<std::ptrdiff_t>(count / 2),
                       means.begin() + static_cast<std::ptrdiff_t>(count));
      if (here - means[count / 2] > most) grid.values[grid.index(column, row)] = kNan;
    }
  });
}

// Passes 1 and 2: the lowest points on the grid of the cloth, which is also that of the terrain.
std::vector<LowCell> lowest_points(const PointBlocks& cloud, double cell_m,
                                   std::optional<double> level_m, Raster& grid) {
  const LowNoise noise(cloud, level_m);
  CellGrid<LowCell> cells(cell_m);
  bool first = !level_m;
  double z0 = level_m.value_or(0.0);
  cloud([&](std::span<const Eigen::Vector3d> points) {
    for (const Eigen::Vector3d& point : points) {
      if (first) z0 = std::floor(point.z());
      first = false;
      if (noise.holds(point)) continue;
      cells.at(point.x(), point.y()).add(static_cast<float>(point.z() - z0));
    }
  });
  std::vector<LowCell> low;
  grid =
      raster_over(cells, 0.0, 0.0, [&](const Raster& raster, std::size_t at, const LowCell& cell) {
        low.resize(raster.values.size());
        low[at] = cell;
      });
  grid.z0 = z0;
  return low;
}

void heights_over(const Raster& terrain, std::span<const Eigen::Vector3d> points,
                  std::vector<double>& heights) {
  heights.resize(points.size());
  parallel_for(points.size(), 4096, [&](std::size_t i) {
    heights[i] = points[i].z() - terrain.interpolate(points[i].x(), points[i].y());
  });
}

// Pass 3: the mean of the points in a thin layer around the provisional terrain. The lowest point
// of a cell lies below the ground by the noise of the ranges; the mean does not.
double refine(const PointBlocks& cloud, const GroundConfig& config, Raster& terrain) {
  std::vector<MeanCell> cells(terrain.values.size());
  std::vector<double> heights;
  cloud([&](std::span<const Eigen::Vector3d> points) {
    heights_over(terrain, points, heights);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3d& point = points[i];
      const double height = heights[i];
      if (!(std::abs(height) <= config.class_m)) continue;
      const int column = terrain.column_of(point.x());
      const int row = terrain.row_of(point.y());
      if (!terrain.contains(column, row)) continue;
      MeanCell& cell = cells[terrain.index(column, row)];
      // Relative to the surface, so that slope and place within the cell do not matter.
      cell.sum += std::llround(MeanCell::kParts * height);
      ++cell.count;
    }
  });
  std::size_t known = 0;
  std::size_t measured = 0;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (!std::isfinite(terrain.values[i])) continue;
    ++known;
    if (cells[i].count < 3) continue;
    ++measured;
    terrain.values[i] += static_cast<float>(cells[i].mean());
  }
  return known == 0 ? 0.0 : static_cast<double>(measured) / static_cast<double>(known);
}

}  // namespace

void describe(ConfigTable& table, GroundConfig& config) {
  table.add("cell_m", config.cell_m, {0.1, 10.0}, "m", "cell of the terrain model and the cloth");
  table.add("stiffness", config.stiffness, {1, 5}, "",
            "stiffness of the cloth: 1 for steep terrain, 2 for rolling, 3 for flat");
  table.add("steps", config.steps, {10, 10'000}, "", "most steps of the cloth");
  table.add("touch_m", config.touch_m, {0.05, 5.0}, "m",
            "lowest points this near to the cloth are ground");
  table.add("class_m", config.class_m, {0.02, 2.0}, "m",
            "points this near to the terrain get the class ground");
  table.add("max_gap_m", config.max_gap_m, {0.0, 1000.0}, "m",
            "how far terrain is filled in from the nearest ground point");
}

double GroundModel::height_above(const Eigen::Vector3d& point) const {
  return point.z() - terrain.interpolate(point.x(), point.y());
}

void GroundModel::heights_above(std::span<const Eigen::Vector3d> points,
                                std::vector<double>& heights) const {
  heights_over(terrain, points, heights);
}

std::uint8_t GroundModel::las_class(double height_above_ground) const {
  if (std::isnan(height_above_ground)) return 1;
  if (height_above_ground < -1.0) return 7;
  if (height_above_ground <= config.class_m) return 2;
  if (height_above_ground <= 0.5) return 3;
  return height_above_ground <= 2.0 ? 4 : 5;
}

GroundModel estimate_ground(const PointBlocks& unasked, const GroundConfig& config,
                            const ProgressSink& progress, std::optional<double> level_m) {
  const PointBlocks cloud = polled(unasked, progress);
  GroundModel model;
  model.config = config;
  Raster& terrain = model.terrain;
  const std::vector<LowCell> low = lowest_points(cloud, config.cell_m, level_m, terrain);
  if (low.empty()) return model;
  const std::vector<float> floor = floor_heights(terrain, low);
  const std::vector<float> cloth = settle_cloth(floor, terrain.columns, terrain.rows,
                                                {config.stiffness, config.steps}, progress);
  terrain.values.assign(floor.size(), kNan);
  for (std::size_t i = 0; i < floor.size(); ++i) {
    if (floor[i] - cloth[i] <= static_cast<float>(config.touch_m)) terrain.values[i] = floor[i];
  }
  drop_bumps(terrain, static_cast<float>(kBumpCells * config.cell_m));
  drop_bumps(terrain, static_cast<float>(kBumpCells * config.cell_m));
  // What is dropped leaves no hole: terrain reaches as far as with it.
  const int gap = static_cast<int>(std::ceil(config.max_gap_m / config.cell_m));
  const std::vector<char> reached = cells_around_known(terrain, gap);
  std::vector<float> dropped = terrain.values;
  drop_unseen_ground(terrain);
  model.unseen = UnseenGround(terrain);
  for (std::size_t i = 0; i < dropped.size(); ++i) {
    if (std::isfinite(terrain.values[i])) dropped[i] = kNan;
  }
  fill_gaps(terrain, gap, reached, dropped);
  model.measured_share = refine(cloud, config, terrain);
  return model;
}

}  // namespace understory
