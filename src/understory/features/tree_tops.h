#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "understory/geometry/raster.h"

namespace understory {

// How tops are found among points, P2 section on preprocessing.
struct TreeTopConfig {
  double window_m = 1.0;     // radius in the plane in which a top is the highest point
  double neighbour_m = 1.5;  // radius in space of the points around a top
  int least_neighbours = 8;  // with fewer points around it a top is not judged and left out
  // Smallest eigenvalue of the scatter matrix of the points around a top, P2 (1), square metres. A
  // crown spreads in all directions, a wire or a wall does not.
  double least_eigenvalue_m2 = 0.01;
  double least_z_m = -1e9;  // no top lower
};

// A local maximum in z and the points around it.
struct TreeTop {
  std::size_t index = 0;  // of the top among the points given
  Eigen::Vector3f point = Eigen::Vector3f::Zero();
  double smallest_eigenvalue_m2 = 0.0;
  std::vector<std::size_t> neighbours;  // in ascending order, with the top itself
};

// The scatter matrix of points about their mean, P2 (1), square metres: the mean of
// (q - mean)(q - mean)^T. Zero for none.
[[nodiscard]] Eigen::Matrix3d scatter_matrix(std::span<const Eigen::Vector3f> points);

// Tops of a cloud with z up, metres, in the order of their indices. Of equally high points within
// the window the first one counts. Points that are not finite are passed over. Deterministic.
[[nodiscard]] std::vector<TreeTop> find_tree_tops(std::span<const Eigen::Vector3f> points,
                                                  const TreeTopConfig& config);

// Indices of the tops and of the points around them, ascending, each once, of `points` points.
[[nodiscard]] std::vector<std::size_t> top_indices(std::size_t points,
                                                   const std::vector<TreeTop>& tops);

// The cloud that P2 registers: the tops and the points around them, each once, in the order given.
[[nodiscard]] std::vector<Eigen::Vector3f> top_points(std::span<const Eigen::Vector3f> points,
                                                      const std::vector<TreeTop>& tops);

// How tops are found in a raster of canopy heights.
struct CanopyTopConfig {
  double smoothing_m = 0.4;  // standard deviation of a bell: a crown has one top
  double least_height_m = 3.0;
  // A top is the highest within this radius plus so much per metre of its height: tall trees have
  // wide crowns.
  double window_m = 0.7;
  double window_per_m = 0.04;
};

// The bell-weighted mean (`sd_m`, metres) of the cells with a height; NaN where the cell itself has
// none. Frame and unit of the raster.
[[nodiscard]] Raster smoothed_canopy(const Raster& canopy, double sd_m);

// A top in a raster of canopy heights. Frame of the raster, metres.
struct CanopyTop {
  Eigen::Vector2d at = Eigen::Vector2d::Zero();  // between cells, by a parabola
  double height_m = 0.0;  // the highest cell value within a cell of it, not smoothed
};

// Local maxima of canopy heights (above the ground, NaN where nothing is known), row by row from
// the south. Deterministic.
[[nodiscard]] std::vector<CanopyTop> find_canopy_tops(const Raster& canopy,
                                                      const CanopyTopConfig& config);

}  // namespace understory
