#include "understory/features/tree_tops.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <unordered_map>

#include "understory/features/features_constants.h"
#include "understory/geometry/symmetric_eigen.h"

namespace understory {
namespace {

// Points by square columns of the plane.
class PointColumns {
 public:
  PointColumns(std::span<const Eigen::Vector3f> points, double cell_m)
      : points_(points), cell_m_(std::max(1e-3, cell_m)) {
    for (std::size_t i = 0; i < points.size(); ++i)
      if (points[i].allFinite())
        columns_[key(cell(points[i].x()), cell(points[i].y()))].push_back(i);
  }

  // Calls visit(index) for the points of the columns within one column of a point.
  template <typename Visit>
  void around(const Eigen::Vector3f& point, const Visit& visit) const {
    const std::int64_t x = cell(point.x());
    const std::int64_t y = cell(point.y());
    for (std::int64_t row = y - 1; row <= y + 1; ++row) {
      for (std::int64_t column = x - 1; column <= x + 1; ++column) {
        const auto found = columns_.find(key(column, row));
        if (found == columns_.end()) continue;
        for (const std::size_t i : found->second)
          visit(i);
      }
    }
  }

 private:
  [[nodiscard]] std::int64_t cell(float along) const {
    return static_cast<std::int64_t>(std::floor(static_cast<double>(along) / cell_m_));
  }
  static std::int64_t key(std::int64_t column, std::int64_t row) {
    return row * 4'000'037 + column;
  }

  std::span<const Eigen::Vector3f> points_;
  double cell_m_;
  std::unordered_map<std::int64_t, std::vector<std::size_t>> columns_;
};

bool is_highest(std::span<const Eigen::Vector3f> points, std::size_t top,
                const PointColumns& columns, double window_m) {
  const Eigen::Vector3f& point = points[top];
  const auto square = static_cast<float>(window_m * window_m);
  bool highest = true;
  columns.around(point, [&](std::size_t i) {
    const Eigen::Vector3f& other = points[i];
    if ((other - point).head<2>().squaredNorm() > square) return;
    if (other.z() > point.z() || (other.z() == point.z() && i < top)) highest = false;
  });
  return highest;
}

bool is_top(const Raster& raster, const std::vector<float>& heights, int column, int row,
            double window_m) {
  const std::size_t at = raster.index(column, row);
  const double radius = window_m / raster.cell_m;
  const int reach = static_cast<int>(radius);
  for (int r = -reach; r <= reach; ++r) {
    for (int c = -reach; c <= reach; ++c) {
      if (r * r + c * c > radius * radius || !raster.contains(column + c, row + r)) continue;
      const std::size_t other = raster.index(column + c, row + r);
      if (heights[other] > heights[at] || (heights[other] == heights[at] && other < at))
        return false;
    }
  }
  return true;
}

// Where a parabola through three neighbours has its top, in cells from the middle one.
double vertex(double before, double middle, double after) {
  const double bend = before - 2.0 * middle + after;
  if (!std::isfinite(bend) || bend >= 0.0) return 0.0;
  return std::clamp(0.5 * (before - after) / bend, -0.5, 0.5);
}

CanopyTop top_at(const Raster& raster, const std::vector<float>& heights, int column, int row) {
  const auto height = [&](int c, int r) {
    return raster.contains(c, r) ? static_cast<double>(heights[raster.index(c, r)])
                                 : std::numeric_limits<double>::quiet_NaN();
  };
  const double middle = height(column, row);
  CanopyTop top;
  top.at = {raster.x0 +
                raster.cell_m * (column + 0.5 +
                                 vertex(height(column - 1, row), middle, height(column + 1, row))),
            raster.y0 +
                raster.cell_m *
                    (row + 0.5 + vertex(height(column, row - 1), middle, height(column, row + 1)))};
  top.height_m = -std::numeric_limits<double>::infinity();
  for (int r = row - 1; r <= row + 1; ++r) {
    for (int c = column - 1; c <= column + 1; ++c) {
      if (!raster.contains(c, r)) continue;
      const double value = raster.z0 + static_cast<double>(raster.values[raster.index(c, r)]);
      if (std::isfinite(value)) top.height_m = std::max(top.height_m, value);
    }
  }
  return top;
}

}  // namespace

Eigen::Matrix3d scatter_matrix(std::span<const Eigen::Vector3f> points) {
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  if (points.empty()) return scatter;
  const auto count = static_cast<double>(points.size());
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3f& point : points)
    mean += point.cast<double>() / count;
  for (const Eigen::Vector3f& point : points) {
    const Eigen::Vector3d off = point.cast<double>() - mean;
    scatter += off * off.transpose() / count;
  }
  return scatter;
}

std::vector<TreeTop> find_tree_tops(std::span<const Eigen::Vector3f> points,
                                    const TreeTopConfig& config) {
  const PointColumns columns(points, std::max(config.window_m, config.neighbour_m));
  const auto square = static_cast<float>(config.neighbour_m * config.neighbour_m);
  std::vector<TreeTop> tops;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!points[i].allFinite() || static_cast<double>(points[i].z()) < config.least_z_m) continue;
    if (!is_highest(points, i, columns, config.window_m)) continue;
    TreeTop top;
    top.index = i;
    top.point = points[i];
    columns.around(points[i], [&](std::size_t k) {
      if ((points[k] - points[i]).squaredNorm() <= square) top.neighbours.push_back(k);
    });
    if (static_cast<int>(top.neighbours.size()) < config.least_neighbours) continue;
    std::sort(top.neighbours.begin(), top.neighbours.end());
    std::vector<Eigen::Vector3f> near;
    for (const std::size_t k : top.neighbours)
      near.push_back(points[k]);
    top.smallest_eigenvalue_m2 = symmetric_eigenvalues(scatter_matrix(near))[0];
    if (top.smallest_eigenvalue_m2 > config.least_eigenvalue_m2) tops.push_back(std::move(top));
  }
  return tops;
}

std::vector<std::size_t> top_indices(std::size_t points, const std::vector<TreeTop>& tops) {
  std::vector<char> taken(points, 0);
  for (const TreeTop& top : tops) {
    for (const std::size_t i : top.neighbours)
      taken[i] = 1;
  }
  std::vector<std::size_t> indices;
  for (std::size_t i = 0; i < points; ++i)
    if (taken[i] != 0) indices.push_back(i);
  return indices;
}

std::vector<Eigen::Vector3f> top_points(std::span<const Eigen::Vector3f> points,
                                        const std::vector<TreeTop>& tops) {
  std::vector<Eigen::Vector3f> result;
  for (const std::size_t i : top_indices(points.size(), tops))
    result.push_back(points[i]);
  return result;
}

Raster smoothed_canopy(const Raster& raster, double sd_m) {
  const double sd = sd_m / raster.cell_m;
  const int reach = static_cast<int>(std::ceil(features_constants::tree_tops::kSmoothedSds * sd));
  Raster result = raster;
  std::fill(result.values.begin(), result.values.end(), std::numeric_limits<float>::quiet_NaN());
  for (int row = 0; row < raster.rows; ++row) {
    for (int column = 0; column < raster.columns; ++column) {
      const std::size_t at = raster.index(column, row);
      if (!std::isfinite(raster.values[at])) continue;
      double sum = 0.0;
      double weights = 0.0;
      for (int r = -reach; r <= reach; ++r) {
        for (int c = -reach; c <= reach; ++c) {
          if (!raster.contains(column + c, row + r)) continue;
          const auto value = static_cast<double>(raster.values[raster.index(column + c, row + r)]);
          if (!std::isfinite(value)) continue;
          const double weight = sd > 0.0 ? std::exp(-0.5 * (r * r + c * c) / (sd * sd)) : 1.0;
          sum += weight * value;
          weights += weight;
        }
      }
      result.values[at] = static_cast<float>(sum / weights);
    }
  }
  return result;
}

std::vector<CanopyTop> find_canopy_tops(const Raster& canopy, const CanopyTopConfig& config) {
  const std::vector<float> heights = smoothed_canopy(canopy, config.smoothing_m).values;
  std::vector<CanopyTop> tops;
  for (int row = 0; row < canopy.rows; ++row) {
    for (int column = 0; column < canopy.columns; ++column) {
      const double height = canopy.z0 + static_cast<double>(heights[canopy.index(column, row)]);
      if (!(height >= config.least_height_m)) continue;
      if (is_top(canopy, heights, column, row, config.window_m + config.window_per_m * height))
        tops.push_back(top_at(canopy, heights, column, row));
    }
  }
  return tops;
}

}  // namespace understory
