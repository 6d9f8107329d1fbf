#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>

#include "understory/registration/ndt_map.h"

namespace understory::internal {

// Sums of the points of a cell, from its centre.
struct CellMoments {
  double n = 0.0;
  double x = 0.0, y = 0.0, z = 0.0;
  double ray_x = 0.0, ray_y = 0.0, ray_z = 0.0;  // directions from the lidar, of unit length
  double xx = 0.0, xy = 0.0, xz = 0.0, yy = 0.0, yz = 0.0, zz = 0.0;

  void add(double px, double py, double pz) {
    n += 1.0;
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
  void add_ray(double dx, double dy, double dz) {
    ray_x += dx;
    ray_y += dy;
    ray_z += dz;
  }
  // Adds sums taken from a centre that lies at `offset` from this one's.
  void add(const CellMoments& other, const Eigen::Vector3d& offset);
  [[nodiscard]] Eigen::Vector3d mean() const { return Eigen::Vector3d(x, y, z) / n; }
  [[nodiscard]] Eigen::Matrix3d covariance() const;
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
