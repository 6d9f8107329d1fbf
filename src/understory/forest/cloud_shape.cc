#include "understory/forest/cloud_shape.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <tuple>
#include <unordered_map>
#include <vector>

#include "understory/forest/forest_constants.h"

namespace understory {
namespace {

using namespace forest_constants::cloud_shape;

using Eigen::Vector3d;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

double quantile(std::vector<double>& values, double share) {
  if (values.empty()) return kNan;
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

// Every n-th point, about the first one: coordinates of a grid are large.
struct Sample {
  std::vector<Vector3d> points;
  std::size_t step = 1;
};
Sample sample_of(const PointBlocks& cloud) {
  std::size_t all = 0;
  cloud([&](std::span<const Vector3d> points) { all += points.size(); });
  Sample sample;
  sample.step = all / kMostPoints + 1;
  Vector3d first = Vector3d::Zero();
  std::size_t k = 0;
  cloud([&](std::span<const Vector3d> points) {
    for (const Vector3d& point : points) {
      if (k == 0) first = point;
      if (k++ % sample.step == 0) sample.points.emplace_back(point - first);
    }
  });
  return sample;
}

Vector3d percentile(const std::vector<Vector3d>& points, double share) {
  Vector3d result;
  std::vector<double> values(points.size());
  for (int axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < points.size(); ++i)
      values[i] = points[i][axis];
    result[axis] = quantile(values, share);
  }
  return result;
}

// The lowest and highest points of upright columns over a grid.
struct Columns {
  double cell = 0.0;
  int across = 0;
  int along = 0;
  std::vector<double> low;  // NaN: too few points
  std::vector<double> high;

  [[nodiscard]] double low_at(int column, int row) const {
    if (column < 0 || row < 0 || column >= across || row >= along) return kNan;
    return low[static_cast<std::size_t>(row * across + column)];
  }
};

Columns columns_of(const std::vector<Vector3d>& points) {
  const Vector3d from = percentile(points, kOutliers);
  const Vector3d extent = percentile(points, kUpperEnd) - from;
  const double area = extent.x() * extent.y();
  Columns columns;
  columns.cell = std::sqrt(area * std::max(1.0 / (kCellsAcross * kCellsAcross),
                                           kPointsPerCell / static_cast<double>(points.size())));
  // A needle has no grid.
  if (!(columns.cell > 0.0) || extent.head<2>().maxCoeff() > 1e3 * columns.cell) return columns;
  columns.across = static_cast<int>(extent.x() / columns.cell) + 1;
  columns.along = static_cast<int>(extent.y() / columns.cell) + 1;
  std::vector<std::vector<double>> heights(
      static_cast<std::size_t>(columns.across * columns.along));
  for (const Vector3d& point : points) {
    const int column = static_cast<int>(std::floor((point.x() - from.x()) / columns.cell));
    const int row = static_cast<int>(std::floor((point.y() - from.y()) / columns.cell));
    if (column < 0 || row < 0 || column >= columns.across || row >= columns.along) continue;
    heights[static_cast<std::size_t>(row * columns.across + column)].push_back(point.z());
  }
  for (std::vector<double>& cell : heights) {
    const bool enough = cell.size() >= kLeastPoints;
    columns.low.push_back(enough ? quantile(cell, kLowQuantile) : kNan);
    columns.high.push_back(enough ? quantile(cell, kHighQuantile) : kNan);
  }
  return columns;
}

// Steps between neighbours that a slope does not explain.
double roughness_of(const Columns& columns) {
  std::vector<double> steps;
  for (int row = 0; row < columns.along; ++row) {
    for (int column = 0; column < columns.across; ++column) {
      const double here = columns.low_at(column, row);
      for (const auto& [u, v] : {std::pair(1, 0), std::pair(0, 1)}) {
        const double bend =
            0.5 * (columns.low_at(column - u, row - v) + columns.low_at(column + u, row + v)) -
            here;
        if (std::isfinite(bend)) steps.push_back(std::abs(bend));
      }
    }
  }
  return steps.size() < kLeastSteps ? kNan : quantile(steps, 0.5) / columns.cell;
}

double column_height_of(const Columns& columns) {
  std::vector<double> heights;
  std::vector<double> rises;
  for (int row = 0; row < columns.along; ++row) {
    for (int column = 0; column < columns.across; ++column) {
      const double here = columns.low_at(column, row);
      if (!std::isfinite(here)) continue;
      heights.push_back(columns.high[static_cast<std::size_t>(row * columns.across + column)] -
                        here);
      for (const double next : {columns.low_at(column + 1, row), columns.low_at(column, row + 1)})
        if (std::isfinite(next)) rises.push_back(std::abs(next - here));
    }
  }
  if (heights.size() < kLeastColumns) return kNan;
  const double rise = rises.empty() ? 0.0 : quantile(rises, kRiseQuantile);
  return std::max(0.0, quantile(heights, kHeightQuantile) - 2.0 * rise);
}

// Of the plane through the lowest points, fitted again to those near it.
Eigen::Vector2d slope_of(const Columns& columns) {
  std::vector<Vector3d> lows;
  for (int row = 0; row < columns.along; ++row) {
    for (int column = 0; column < columns.across; ++column) {
      const double low = columns.low_at(column, row);
      if (std::isfinite(low)) lows.emplace_back(column * columns.cell, row * columns.cell, low);
    }
  }
  if (lows.size() < kLeastSteps) return Eigen::Vector2d::Constant(kNan);
  Vector3d plane = Vector3d::Zero();  // z = a x + b y + c
  double width = std::numeric_limits<double>::infinity();
  for (int round = 0; round < kPlaneRounds; ++round) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Vector3d right = Vector3d::Zero();
    std::vector<double> off;
    for (const Vector3d& low : lows) {
      const Vector3d row(low.x(), low.y(), 1.0);
      const double error = std::abs(low.z() - row.dot(plane));
      off.push_back(error);
      if (round > 0 && error > width) continue;
      normal += row * row.transpose();
      right += low.z() * row;
    }
    // Lows in one row leave a slope open, which this solver leaves at zero.
    plane = normal.colPivHouseholderQr().solve(right);
    for (std::size_t i = 0; i < lows.size(); ++i)
      off[i] = std::abs(lows[i].z() - Vector3d(lows[i].x(), lows[i].y(), 1.0).dot(plane));
    width = kPlaneMedians * quantile(off, 0.5);
  }
  return plane.head<2>();
}

double alone_share_of(const std::vector<Vector3d>& points, double cube) {
  std::unordered_map<std::uint64_t, std::uint32_t> cubes;
  cubes.reserve(points.size());
  for (const Vector3d& point : points) {
    std::uint64_t key = 0;
    for (int axis = 0; axis < 3; ++axis)  // 21 bits each
      key = key << 21U |
            (static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(point[axis] / cube))) &
             0x1fffffU);
    ++cubes[key];
  }
  std::size_t alone = 0;
  for (const auto& [key, count] : cubes)
    alone += count == 1 ? 1 : 0;
  return points.empty() ? 0.0 : static_cast<double>(alone) / static_cast<double>(points.size());
}

double lean_deg(const Vector3d& axis) {
  return std::acos(std::clamp(axis.z(), -1.0, 1.0)) * 180.0 / M_PI;
}

// Whether stems stand clearly along another direction than z.
bool leans(const StandingDirection& found) {
  return found.gain > kLeastGain && found.gain > kLeastGainOverZ * found.gain_of_z &&
         lean_deg(found.axis) > kLeastLeanDeg;
}

bool is_slice(const CloudShape& shape) {
  return shape.extent.minCoeff() < std::max(kThinnest, kThinnestShare * shape.extent.maxCoeff()) &&
         shape.extent.z() <= shape.extent.minCoeff();
}

}  // namespace

std::string to_string(UpAxis axis) {
  switch (axis) {
    case UpAxis::kZ:
      return "z";
    case UpAxis::kMinusZ:
      return "-z";
    case UpAxis::kX:
      return "x";
    case UpAxis::kMinusX:
      return "-x";
    case UpAxis::kY:
      return "y";
    case UpAxis::kMinusY:
      break;
  }
  return "-y";
}

Eigen::Matrix3d upright_from_cloud(UpAxis axis) {
  Vector3d up = Vector3d::UnitZ();
  if (axis == UpAxis::kMinusZ) up = -Vector3d::UnitZ();
  if (axis == UpAxis::kX) up = Vector3d::UnitX();
  if (axis == UpAxis::kMinusX) up = -Vector3d::UnitX();
  if (axis == UpAxis::kY) up = Vector3d::UnitY();
  if (axis == UpAxis::kMinusY) up = -Vector3d::UnitY();
  const Vector3d first = std::abs(up.x()) > 0.5 ? Vector3d::UnitY() : Vector3d::UnitX();
  Eigen::Matrix3d rotation;
  rotation << first.transpose(), up.cross(first).transpose(), up.transpose();
  return rotation;
}

CloudShape shape_of(const PointBlocks& cloud) {
  const Sample sample = sample_of(cloud);
  return shape_of_sample(sample.points, sample.step);
}

CloudShape shape_of_sample(const std::vector<Vector3d>& points, std::size_t step) {
  CloudShape shape;
  shape.points = points.size();
  shape.roughness.fill(kNan);
  shape.column_height = shape.ground_slope_deg = kNan;
  shape.ground_slope.fill(kNan);
  if (points.size() < kLeastPoints) return shape;
  shape.extent = percentile(points, kUpperEnd) - percentile(points, kOutliers);
  // A sample of surfaces is as much sparser as if its cubes were smaller by the root.
  shape.alone_share = alone_share_of(points, kCube * std::sqrt(static_cast<double>(step)));
  for (std::size_t k = 0; k < kUpAxes.size(); ++k) {
    const Eigen::Matrix3d turn = upright_from_cloud(kUpAxes[k]);
    std::vector<Vector3d> turned;
    turned.reserve(points.size());
    for (const Vector3d& point : points)
      turned.emplace_back(turn * point);
    const Columns columns = columns_of(turned);
    shape.roughness[k] = roughness_of(columns);
    if (kUpAxes[k] != UpAxis::kZ) continue;
    shape.column_height = column_height_of(columns);
    shape.ground_slope = slope_of(columns);
    shape.ground_slope_deg = std::atan(shape.ground_slope.norm()) * 180.0 / M_PI;
    if (shape.ground_slope.allFinite())
      shape.standing = standing_direction(points, shape.ground_slope);
  }
  return shape;
}

std::optional<UpAxis> other_up_axis(const CloudShape& shape) {
  if (is_slice(shape)) return std::nullopt;
  std::size_t best = 0;
  for (std::size_t k = 1; k < kUpAxes.size(); ++k) {
    if (shape.roughness[k] < shape.roughness[best] || !std::isfinite(shape.roughness[best]))
      best = k;
  }
  const double as_given = shape.roughness[0];
  const double smoothest = shape.roughness[best];
  const bool smooth = smoothest < kSmooth && as_given > std::max(kRough, kClearly * smoothest);
  // A steep or bushy ground, which the crowns beside it leave no doubt about. Stems tell the
  // direction of a tilted cloud better.
  const bool tilted = shape.standing && leans(*shape.standing);
  const bool smooth_beside =
      !tilted && smoothest < kSmoothBeside && as_given > kFarClearer * smoothest;
  const bool clear = best != 0 && (smooth || smooth_beside);
  return clear ? std::optional(kUpAxes[best]) : std::nullopt;
}

std::optional<Eigen::Vector3d> leaning_axis(const CloudShape& shape) {
  if (!shape.standing || is_slice(shape) || other_up_axis(shape)) return std::nullopt;
  return leans(*shape.standing) ? std::optional(shape.standing->axis) : std::nullopt;
}

std::string up_complaint(const CloudShape& shape) {
  if (const auto axis = other_up_axis(shape))
    return fmt::format("z is not up: smooth ground lies below the points along {}, not along z",
                       to_string(*axis));
  if (const auto axis = leaning_axis(shape))
    return fmt::format("z is not up: all stems lean by {:.0f} degrees the same way",
                       lean_deg(*axis));
  if (shape.roughness[0] < kSmooth && shape.ground_slope_deg > kSteepestDeg && !is_slice(shape))
    return fmt::format("z is not up: the ground is inclined by {:.0f} degrees",
                       shape.ground_slope_deg);
  return {};
}

std::string unit_complaint(const CloudShape& shape) {
  const std::string size = fmt::format("it measures {:.0f} x {:.0f} x {:.0f}", shape.extent.x(),
                                       shape.extent.y(), shape.extent.z());
  if (shape.extent.head<2>().maxCoeff() < kWidestDegrees && shape.extent.z() > kLeastHeight)
    return fmt::format(
        "it measures {:.6f} x {:.6f} in the plane and {:.1f} in height: these look like degrees",
        shape.extent.x(), shape.extent.y(), shape.extent.z());
  if (shape.column_height > kTallestCentimetres)
    return fmt::format("{}, and points stand {:.0f} above the ground: these look like millimetres",
                       size, shape.column_height);
  if (shape.column_height > kTallest)
    return fmt::format(
        "{}, and points stand {:.0f} above the ground: these look like centimetres (or "
        "millimetres)",
        size, shape.column_height);
  if (shape.alone_share > kMostAlone)
    return fmt::format(
        "{}, and {:.0f} % of its points have no other one in their cube of 3 m: these look like "
        "millimetres or centimetres",
        size, 100.0 * shape.alone_share);
  return {};
}

std::string feet_suspicion(const CloudShape& shape) {
  if (!(shape.column_height > kTallForMetres) || !unit_complaint(shape).empty()) return {};
  return fmt::format("points stand {:.0f} above the ground: tall for metres, usual for feet",
                     shape.column_height);
}

}  // namespace understory
