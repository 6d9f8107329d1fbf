#include "understory/registration/global/level_cloud.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "understory/geometry/symmetric_eigen.h"
#include "understory/geometry/voxel_index.h"
#include "understory/registration/global/global_constants.h"

namespace understory {
namespace {

using namespace registration_constants::level_cloud;

std::uint64_t cell_key(const Eigen::Vector3f& point, float per_m) {
  return voxel_key(static_cast<int>(std::floor(point.x() * per_m)),
                   static_cast<int>(std::floor(point.y() * per_m)),
                   static_cast<int>(std::floor(point.z() * per_m)));
}

// The first and second moments of the points of a cell, from its first point.
struct Moments {
  Eigen::Vector3f origin;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  int count = 0;

  void add(const Eigen::Vector3f& point) {
    const Eigen::Vector3d d = (point - origin).cast<double>();
    sum += d;
    squares.noalias() += d * d.transpose();
    ++count;
  }
  [[nodiscard]] Eigen::Matrix3d covariance() const {
    const Eigen::Vector3d mean = sum / count;
    return squares / count - mean * mean.transpose();
  }
};

// What says where up is: up lies along a line, or across the normal of an upright surface.
struct UprightHint {
  Eigen::Vector3d direction;
  bool line = false;
  double weight = 0.0;
};

std::vector<Moments> moments_of_cells(const Points& points, double edge_m) {
  const auto per_m = static_cast<float>(1.0 / edge_m);
  VoxelIndex index;
  std::vector<Moments> cells;
  for (const Eigen::Vector3f& point : points) {
    const std::uint64_t key = cell_key(point, per_m);
    std::uint32_t found = index.find(key);
    if (found == VoxelIndex::kNone) {
      found = static_cast<std::uint32_t>(cells.size());
      index.set(key, found);
      cells.push_back({.origin = point});
    }
    cells[found].add(point);
  }
  return cells;
}

std::vector<UprightHint> hints_of(const Points& points) {
  std::vector<UprightHint> hints;
  for (const double edge_m : kCellEdges) {
    for (const Moments& cell : moments_of_cells(points, edge_m)) {
      if (cell.count < kCellPoints) continue;
      const SymmetricEigen3 eigen = fast_symmetric_eigen(cell.covariance());
      const double weight = std::min(cell.count, kMostWeight);
      if (eigen.values[1] < kLineShare * eigen.values[2]) {
        hints.push_back({eigen.vectors.col(2), true, weight});
      } else if (eigen.values[0] < kPlaneShare * eigen.values[1]) {
        hints.push_back({eigen.vectors.col(0), false, weight});
      }
    }
  }
  return hints;
}

bool agrees(const UprightHint& hint, const Eigen::Vector3d& up, double sine) {
  const double along = std::abs(hint.direction.dot(up));
  return hint.line ? along * along > 1.0 - sine * sine : along < sine;
}

UpEstimate follow(const std::vector<UprightHint>& hints, Eigen::Vector3d up) {
  UpEstimate estimate;
  for (const double sine : kSines) {
    Eigen::Matrix3d against = Eigen::Matrix3d::Zero();
    estimate.weight = 0.0;
    for (const UprightHint& hint : hints) {
      if (!agrees(hint, up, sine)) continue;
      const Eigen::Matrix3d outer = hint.direction * hint.direction.transpose();
      against +=
          hint.weight * (hint.line ? Eigen::Matrix3d(Eigen::Matrix3d::Identity() - outer) : outer);
      estimate.weight += hint.weight;
    }
    if (estimate.weight < kLeastWeight) break;
    const SymmetricEigen3 eigen = fast_symmetric_eigen(against);
    // Walls that all face one way leave up open about their normal.
    if (eigen.values[1] < kOpenTurn * eigen.values[2]) break;
    const Eigen::Vector3d next = eigen.vectors.col(0);
    up = next.z() < 0.0 ? Eigen::Vector3d(-next) : next;
  }
  estimate.up = up;
  return estimate;
}

// The direction that most surfaces within 45 degrees of level face.
Eigen::Vector3d ground_normal(const std::vector<UprightHint>& hints) {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  for (const double cosine : {0.7, 0.85, 0.95, 0.97}) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const UprightHint& hint : hints) {
      const double along = hint.direction.dot(normal);
      if (!hint.line && std::abs(along) > cosine)
        sum += (along < 0.0 ? -hint.weight : hint.weight) * hint.direction;
    }
    if (sum.norm() < kLeastWeight) break;
    normal = sum.normalized();
  }
  return normal;
}

}  // namespace

Points voxel_means(const Points& points, double edge_m) {
  struct Mean {
    Eigen::Vector3f origin;
    Eigen::Vector3f sum;
    int count;
  };
  const auto per_m = static_cast<float>(1.0 / edge_m);
  VoxelIndex index;
  std::vector<Mean> voxels;
  for (const Eigen::Vector3f& point : points) {
    if (!(point.cwiseAbs().maxCoeff() < kFarthest)) continue;
    const std::uint64_t key = cell_key(point, per_m);
    const std::uint32_t found = index.find(key);
    if (found == VoxelIndex::kNone) {
      index.set(key, static_cast<std::uint32_t>(voxels.size()));
      voxels.push_back({point, Eigen::Vector3f::Zero(), 1});
    } else {
      voxels[found].sum += point - voxels[found].origin;
      ++voxels[found].count;
    }
  }
  Points means;
  means.reserve(voxels.size());
  for (const Mean& voxel : voxels)
    means.push_back(voxel.origin + voxel.sum / static_cast<float>(voxel.count));
  return means;
}

UpEstimate estimate_up(const Points& points) {
  const std::vector<UprightHint> hints = hints_of(points);
  UpEstimate best;
  for (const Eigen::Vector3d& start :
       {Eigen::Vector3d(Eigen::Vector3d::UnitZ()), ground_normal(hints)}) {
    const UpEstimate found = follow(hints, start);
    if (found.weight > best.weight && found.up.z() > kLeastCosine) best = found;
  }
  return best;
}

GroundGrid::GroundGrid(const Points& points) {
  if (points.empty()) return;
  Eigen::Vector2f high = points.front().head<2>();
  low_ = high;
  for (const Eigen::Vector3f& point : points) {
    low_ = low_.cwiseMin(point.head<2>());
    high = high.cwiseMax(point.head<2>());
  }
  // Of a cloud that reaches very far the middle tells enough.
  const Eigen::Vector2f middle = 0.5F * (low_ + high);
  low_ = low_.cwiseMax(middle - Eigen::Vector2f::Constant(0.5F * kMostCells));
  high = high.cwiseMin(middle + Eigen::Vector2f::Constant(0.5F * kMostCells));
  columns_ = static_cast<int>(high.x() - low_.x()) + 1;
  rows_ = static_cast<int>(high.y() - low_.y()) + 1;
  // The second lowest point of a cell: a single point below the ground is an echo's fault.
  const float none = std::numeric_limits<float>::infinity();
  std::vector<std::array<float, 2>> lowest(static_cast<std::size_t>(columns_ * rows_),
                                           {none, none});
  for (const Eigen::Vector3f& point : points) {
    const int column = static_cast<int>(std::floor(point.x() - low_.x()));
    const int row = static_cast<int>(std::floor(point.y() - low_.y()));
    if (column < 0 || row < 0 || column >= columns_ || row >= rows_) continue;
    std::array<float, 2>& cell = lowest[static_cast<std::size_t>(row * columns_ + column)];
    if (point.z() < cell[0]) {
      cell[1] = cell[0];
      cell[0] = point.z();
    } else {
      cell[1] = std::min(cell[1], point.z());
    }
  }
  heights_.reserve(lowest.size());
  for (const auto& cell : lowest)
    heights_.push_back(cell[1]);
  spread();
}

// The ground rises from a low place by no more than its steepest slope: what stands higher is a
// plant. Two sweeps to and fro carry that over the grid and fill its gaps.
void GroundGrid::spread() {
  const auto relax = [&](int column, int row, int from_column, int from_row) {
    if (from_column < 0 || from_row < 0 || from_column >= columns_ || from_row >= rows_) return;
    float& here = heights_[static_cast<std::size_t>(row * columns_ + column)];
    const float there = heights_[static_cast<std::size_t>(from_row * columns_ + from_column)];
    const bool aslant = column != from_column && row != from_row;
    here = std::min(here, there + kSteepest * (aslant ? 1.4142F : 1.0F));
  };
  for (int round = 0; round < 2; ++round) {
    for (int row = 0; row < rows_; ++row) {
      for (int column = 0; column < columns_; ++column) {
        for (int side = -1; side <= 1; ++side)
          relax(column, row, column + side, row - 1);
        relax(column, row, column - 1, row);
      }
      for (int column = columns_ - 1; column >= 0; --column)
        relax(column, row, column + 1, row);
    }
    for (int row = rows_ - 1; row >= 0; --row) {
      for (int column = columns_ - 1; column >= 0; --column) {
        for (int side = -1; side <= 1; ++side)
          relax(column, row, column + side, row + 1);
        relax(column, row, column + 1, row);
      }
    }
  }
}

float GroundGrid::at(float x, float y) const {
  if (heights_.empty()) return 0.0F;
  const int column = std::clamp(static_cast<int>(std::floor(x - low_.x())), 0, columns_ - 1);
  const int row = std::clamp(static_cast<int>(std::floor(y - low_.y())), 0, rows_ - 1);
  const float height = heights_[static_cast<std::size_t>(row * columns_ + column)];
  return std::isfinite(height) ? height : 0.0F;
}

}  // namespace understory
