#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "understory/forest/cell_grid.h"

namespace understory {

// Where a cloud holds few points near the ground, so that stems may be missing.
struct ThinCoverage {
  double cell_m = 0.0;
  std::vector<Eigen::Vector2d> corners;  // south-western ones of the thin cells, by row and column
  double share = 0.0;                    // of the cells that hold a point near the ground
  // Of these cells, those so dense that a stem would show, and points near breast height on a
  // square metre of them.
  double dense_share = 0.0;
  double near_breast_per_m2 = 0.0;
};

// Counts points near the ground by cells of 4 m. Not thread-safe.
class CoverageGrid {
 public:
  CoverageGrid();
  // A point up to 3.5 m above the ground; `near_breast`: of the heights that are searched for
  // stems.
  void add(const Eigen::Vector2d& place, bool near_breast);
  void add(const CoverageGrid& other);  // what another one counted
  // Cells with fewer than 5 points per square metre. At 10 m from a lidar held 1.5 m high a stem of
  // 20 cm then has fewer than 25 points up to 3.5 m. The search for stems wants as many.
  [[nodiscard]] ThinCoverage thin() const;

 private:
  struct Counts {
    std::uint32_t all = 0;
    std::uint32_t near_breast = 0;
  };
  CellGrid<Counts> counts_;
};

}  // namespace understory
