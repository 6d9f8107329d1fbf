#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

namespace understory {

// Delaunay triangulation of points in the plane: counter-clockwise triangles of indices. For a few
// thousand points (time grows with n^1.5); doubles of a point are left out. Empty for fewer than
// three points or points on one line. Deterministic; thread-safe.
[[nodiscard]] std::vector<std::array<int, 3>> delaunay_triangles(
    const std::vector<Eigen::Vector2d>& points);

// Natural neighbours: the points joined to each point by an edge of the triangulation, ascending.
[[nodiscard]] std::vector<std::vector<int>> natural_neighbours(
    const std::vector<Eigen::Vector2d>& points);

// L0 of P0 (23): mean over the points of the mean distance to their natural neighbours, metres. 0
// where there is no triangulation. Points of the convex hull have neighbours along the edge of the
// view. They are left out where enough others are left (the paper leaves out the periphery).
[[nodiscard]] double mean_neighbour_distance(const std::vector<Eigen::Vector2d>& points);

}  // namespace understory
