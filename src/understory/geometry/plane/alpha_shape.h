#pragma once

#include <Eigen/Core>
#include <vector>

namespace understory {

// Clusters of points in the plane by their alpha shape. Triangles of the Delaunay triangulation
// whose circumscribed circle is not larger than `radius_m` belong to the shape. Triangles that
// share a corner belong to one cluster (Akkiraju et al. 1995; P0 section 2.5, P1 section 2.3).
//
// Returns a cluster's number for every point, in the order of each cluster's first point, or -1 for
// points outside the shape. Points nearer to each other than a 25th of the radius count as one
// corner, so many sights of one tree cost little. A spot of such points and nothing around it is a
// cluster, too. Deterministic; thread-safe; same result for any number of threads.
[[nodiscard]] std::vector<int> alpha_clusters(const std::vector<Eigen::Vector2d>& points,
                                              double radius_m);

}  // namespace understory
