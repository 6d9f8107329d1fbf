#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include "understory/geometry/plane/plane_grid.h"
#include "understory/geometry/points.h"
#include "understory/geometry/pose.h"

namespace understory {

// Sharpness of a sparse map without truth, P0 section 2.5: how little the sights of one tree,
// placed by the poses of their views, lie apart. A map that is all views' stems laid into one
// frame.
struct SharpnessConfig {
  double fine_m = 0.2;          // epsilon 1 of (30)
  double coarse_m = 10.0;       // epsilon 2
  double alpha_radius_m = 0.5;  // of the alpha shapes that gather a tree's sights
  int min_points = 15;          // clusters of fewer sights are no trees
};

// Points of all views in the map's frame. `use` leaves out views where 0 (empty: all are used).
[[nodiscard]] SparsePoints map_points(const std::vector<SparsePoints>& views,
                                      const std::vector<Pose>& map_from_view,
                                      const std::vector<char>& use);

// Blur ratio beta, P0 (30), of the map seen from above: area of the fine cells that hold a point
// over that of the coarse ones. 0..1, smaller is sharper; 0 for no points.
[[nodiscard]] double blur_ratio(const SparsePoints& map, const SharpnessConfig& config);
// The same in space, with the cube of the cells' sides (P0 section 4).
[[nodiscard]] double blur_ratio_3d(const SparsePoints& map, const SharpnessConfig& config);

// Box-counting dimension, P0 section 4: slope of the logarithm of the number of occupied cells over
// that of their fineness. Least squares over cells of 1, 2, 4 and 8 times `fine_m`, in which trees
// stay apart. 0 for points, 1 for lines, 2 for areas (seen from above), 3 (in space).
[[nodiscard]] double box_dimension(const SparsePoints& map, const SharpnessConfig& config,
                                   bool in_space);

// Tree registration noise, P0 section 2.5 and (33): distances of sights from the mean of their
// cluster, seen from above. The paper's e_C is over all clusters. A cluster is several trees side
// by side where a view in five or more has two sights of it. Their sights have run together and the
// width is no noise, so ours leaves it out. On a simulated site one such pair among 596 trees took
// e_C from 4.9 to 7.4 cm.
struct RegistrationNoise {
  // e_C by (33), as the paper has it: root mean square over the sights of all clusters, metres. NaN
  // without a cluster.
  double clusters_m = std::numeric_limits<double>::quiet_NaN();
  // Mean over all clusters of each one's root mean square: the figure of P0's table 1.
  double clusters_mean_m = std::numeric_limits<double>::quiet_NaN();
  // The same two of the clusters that are single trees.
  double pooled_m = std::numeric_limits<double>::quiet_NaN();
  double mean_m = std::numeric_limits<double>::quiet_NaN();
  std::size_t trees = 0;
  std::size_t joined = 0;  // clusters left out as several trees
  std::size_t sights = 0;
  // Of each view: sum of the squared distances of its sights, and their number. The share w_i of
  // (33) is squares / sights of the whole map.
  std::vector<double> squares_m2;
  std::vector<int> counts;
};
[[nodiscard]] RegistrationNoise registration_noise(const std::vector<SparsePoints>& views,
                                                   const std::vector<Pose>& map_from_view,
                                                   const std::vector<char>& use,
                                                   const SharpnessConfig& config);

// All of them at once, for run.json and the report.
struct MapSharpness {
  double beta = 0.0;
  double beta_3d = 0.0;
  double dimension = 0.0;
  double dimension_3d = 0.0;
  double cluster_noise_m = 0.0;       // e_C by (33), of all clusters
  double cluster_noise_mean_m = 0.0;  // by table 1
  double noise_m = 0.0;               // the same of single trees
  double noise_mean_m = 0.0;
  std::size_t trees = 0;
  std::size_t joined = 0;  // clusters of several trees: clusters are both together
};
[[nodiscard]] MapSharpness map_sharpness(const std::vector<SparsePoints>& views,
                                         const std::vector<Pose>& map_from_view,
                                         const std::vector<char>& use,
                                         const SharpnessConfig& config);

// Views whose sights lie so far from the trees that the map is better without them, P0 section 4.2
// and (33). They have a mean square of more than `factor` times the median. The worst come first,
// at most `max_share` of all. 0 in the result: left out. `factor` <= 0 keeps all.
[[nodiscard]] std::vector<char> views_worth_keeping(const RegistrationNoise& noise, double factor,
                                                    double max_share);

}  // namespace understory
