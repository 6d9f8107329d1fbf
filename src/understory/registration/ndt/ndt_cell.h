#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>

#include "understory/registration/ndt/ndt_map.h"

namespace understory::internal {

// Sums of the points of a cell, from its centre.
struct CellMoments {
  double n = 0.0;
  double x = 0.0, y = 0.0, z = 0.0;
  double ray_x = 0.0, ray_y = 0.0, ray_z = 0.0;  // directions from the lidar, of unit length
  double xx = 0.0, xy = 0.0, xz = 0.0, yy = 0.0, yz = 0.0, zz = 0.0;

  // Adds sums taken from a centre that lies at `offset` from this one's.
  void add(const CellMoments& other, const Eigen::Vector3d& offset);
  [[nodiscard]] Eigen::Vector3d mean() const { return Eigen::Vector3d(x, y, z) / n; }
  [[nodiscard]] Eigen::Matrix3d covariance() const;
};

// The same sums in single precision, half as large, for maps of many cells. With the points within
// a cell of its centre, variances come out to 1e-5 of the cell's squared edge after 1e5 points.
struct StoredMoments {
  float n = 0.0F;
  float x = 0.0F, y = 0.0F, z = 0.0F;
  float ray_x = 0.0F, ray_y = 0.0F, ray_z = 0.0F;
  float xx = 0.0F, xy = 0.0F, xz = 0.0F, yy = 0.0F, yz = 0.0F, zz = 0.0F;

  void add(float px, float py, float pz) {
    n += 1.0F;
    x += px;
    y += py;
    z += pz;
    xx += px * px;
    xy += px * py;
    xz += px * pz;
    yy += py * py;
    yz += py * pz;
    zz += pz * pz;
  }
  void add_ray(float dx, float dy, float dz) {
    ray_x += dx;
    ray_y += dy;
    ray_z += dz;
  }
  [[nodiscard]] CellMoments wide() const {
    return {n, x, y, z, ray_x, ray_y, ray_z, xx, xy, xz, yy, yz, zz};
  }
};

// As far as a cell's surroundings are asked, in cells.
constexpr int kSurroundings = 2;

// Moments of a cell together with its neighbours up to `reach` cells away on each side.
using MomentsAround = std::function<CellMoments(int reach)>;

// The distribution of a cell, P4 (40), made safe to match against (see NdtCell). `around` is asked
// only where the cell alone cannot tell a surface from the trace of a ring.
[[nodiscard]] NdtCell make_cell(const CellMoments& moments, const NdtMapConfig& config,
                                const MomentsAround& around);

}  // namespace understory::internal
