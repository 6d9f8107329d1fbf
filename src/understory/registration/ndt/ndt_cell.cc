#include "understory/registration/ndt/ndt_cell.h"

#include <algorithm>
#include <cmath>

#include "understory/geometry/symmetric_eigen.h"
#include "understory/registration/registration_constants.h"

namespace understory::internal {
namespace {

using namespace registration_constants::ndt_cell;

struct Shape {
  Eigen::Vector3d variance;  // ascending
  Eigen::Matrix3d axes;      // columns
};

Shape shape_of(const Eigen::Matrix3d& covariance) {
  const SymmetricEigen3 eigen = fast_symmetric_eigen(covariance);
  return {eigen.values.cwiseMax(0.0), eigen.vectors};
}

bool is_line(const Shape& shape, double floor) {
  return shape.variance[1] < kLineRatio * shape.variance[2] + kLineNoise * floor;
}

bool is_plane(const Shape& shape, double floor) {
  return shape.variance[0] < kPlaneRatio * shape.variance[1] + kPlaneNoise * floor;
}

// Seen from one side only, and by rays that lie in the surface. A ring spreads whatever it meets,
// such as grass, over the cone of its rays.
bool is_edge_on(const CellMoments& moments, const Eigen::Vector3d& normal) {
  const Eigen::Vector3d ray =
      Eigen::Vector3d(moments.ray_x, moments.ray_y, moments.ray_z) / moments.n;
  return ray.norm() > kOneSide && std::abs(normal.dot(ray)) < kGrazing;
}

void add_row(NdtCell& cell, const Eigen::Vector3d& direction, double information) {
  if (information <= 0.0) return;
  cell.row[static_cast<std::size_t>(cell.rows++)] =
      (direction * std::sqrt(information)).cast<float>();
}

// The surface on which the trace of a ring lies, as its surroundings show it: a row that holds
// across the surface alone. False if they show none.
bool add_row_of_surroundings(NdtCell& cell, const Eigen::Matrix3d& covariance,
                             const NdtMapConfig& config, const MomentsAround& around) {
  const double floor = config.sigma_floor_m * config.sigma_floor_m;
  for (int reach = 1; reach <= kSurroundings; ++reach) {
    const CellMoments moments = around(reach);
    const Shape shape = shape_of(moments.covariance());
    if (is_line(shape, floor)) continue;
    const Eigen::Vector3d normal = shape.axes.col(0);
    if (!is_plane(shape, floor) || (config.few_rings && is_edge_on(moments, normal))) return false;
    const double own = normal.dot(covariance * normal);
    add_row(cell, normal, 1.0 / (std::max(own, shape.variance[0]) + floor));
    return true;
  }
  return false;
}

}  // namespace

void CellMoments::add(const CellMoments& other, const Eigen::Vector3d& offset) {
  const double a = offset.x();
  const double b = offset.y();
  const double c = offset.z();
  n += other.n;
  ray_x += other.ray_x;
  ray_y += other.ray_y;
  ray_z += other.ray_z;
  x += other.x + other.n * a;
  y += other.y + other.n * b;
  z += other.z + other.n * c;
  xx += other.xx + 2.0 * a * other.x + other.n * a * a;
  yy += other.yy + 2.0 * b * other.y + other.n * b * b;
  zz += other.zz + 2.0 * c * other.z + other.n * c * c;
  xy += other.xy + a * other.y + b * other.x + other.n * a * b;
  xz += other.xz + a * other.z + c * other.x + other.n * a * c;
  yz += other.yz + b * other.z + c * other.y + other.n * b * c;
}

Eigen::Matrix3d CellMoments::covariance() const {
  const Eigen::Vector3d m = mean();
  Eigen::Matrix3d products;
  products << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  return (products - n * m * m.transpose()) / std::max(1.0, n - 1.0);
}

NdtCell make_cell(const CellMoments& moments, const NdtMapConfig& config,
                  const MomentsAround& around) {
  NdtCell cell;
  cell.row.fill(Eigen::Vector3f::Zero());
  cell.count = static_cast<std::uint32_t>(moments.n);
  cell.mean = moments.mean().cast<float>();
  const Eigen::Matrix3d covariance = moments.covariance();
  const Shape shape = shape_of(covariance);
  const double floor = config.sigma_floor_m * config.sigma_floor_m;
  // A cell evenly filled has this variance and says nothing.
  const double box = config.cell_size_m * config.cell_size_m / 12.0 + floor;

  const bool line = is_line(shape, floor);
  if (line) {
    if (std::abs(shape.axes.col(2).z()) < kPoleCosine) {
      add_row_of_surroundings(cell, covariance, config, around);
      return cell;
    }
  } else if (is_plane(shape, floor)) {
    const bool strip = config.few_rings && shape.variance[1] < kStripShare * box;
    const bool edge_on = config.few_rings && is_edge_on(moments, shape.axes.col(0));
    if ((strip || edge_on) && add_row_of_surroundings(cell, covariance, config, around))
      return cell;
    if (edge_on) return cell;
    add_row(cell, shape.axes.col(0), 1.0 / (shape.variance[0] + floor) - 1.0 / box);
    return cell;
  }
  if (config.viewpoint_in_source) {
    const double depth =
        (line ? config.near_side_line : config.near_side_volume) * std::sqrt(shape.variance[1]);
    const Eigen::Vector3d rays(moments.ray_x, moments.ray_y, moments.ray_z);
    cell.near_side_m = static_cast<float>(depth);
    cell.mean_near_side = (depth / moments.n * rays).cast<float>();
  }
  const double longest = std::min(shape.variance[2] + floor, box);
  // What is neither surface nor line is seen from one side only, and that side goes with the lidar
  // (docs/method/registration.md). What NdtCell::near_side_m leaves of that counts little. The same
  // goes for the second direction, along which a cell ends where the lidar could no longer see it.
  const double share = line ? 1.0 : config.volume_weight;
  for (int i = 0; i < 2; ++i) {
    const double weight = share * (i == 0 ? 1.0 : config.second_axis_weight);
    add_row(cell, shape.axes.col(i), weight * (1.0 / (shape.variance[i] + floor) - 1.0 / longest));
  }
  return cell;
}

}  // namespace understory::internal
