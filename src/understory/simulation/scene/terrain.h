#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "understory/simulation/carrier/route.h"
#include "understory/simulation/site.h"

namespace understory {

// The ground: a grid of heights in the world frame (east-north-up), each cell cut into two
// triangles from its south-west to its north-east corner. What is measured of it and what is
// scanned is the same surface. Immutable, thread-safe.
class Terrain {
 public:
  // Covers the rectangle of +-half_x_m, +-half_y_m around the origin. With snow, the surface is
  // that of the snow, pressed down along `way` where one is given.
  Terrain(const TerrainConfig& config, double half_x_m, double half_y_m, std::uint64_t seed,
          const Route* way = nullptr);

  // Height of the surface in metres; outside of the grid that of its edge.
  [[nodiscard]] double height(double x, double y) const;
  // Mean height over a disc, what feet and wheels follow.
  [[nodiscard]] double smooth_height(double x, double y, double radius_m) const;

  [[nodiscard]] int columns() const { return columns_; }  // grid points, east
  [[nodiscard]] int rows() const { return rows_; }        // grid points, north
  [[nodiscard]] double cell_m() const { return cell_m_; }
  [[nodiscard]] Eigen::Vector3d vertex(int column, int row) const;

 private:
  [[nodiscard]] double at(int column, int row) const {
    return heights_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                    static_cast<std::size_t>(column)];
  }

  int columns_ = 0;
  int rows_ = 0;
  double cell_m_ = 1.0;
  double west_m_ = 0.0;
  double south_m_ = 0.0;
  std::vector<double> heights_;
};

}  // namespace understory
