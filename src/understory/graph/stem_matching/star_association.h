#pragma once

#include <Eigen/Core>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/registration/stems/sparse_icp.h"

namespace understory {

// The stems of a view, each with its star: where its natural neighbours in the Delaunay
// triangulation lie from it. The localisation that P0's section 3 names uses such stars.
struct StarView {
  std::vector<Eigen::Vector2d> stems;               // level frame of the view, metres
  std::vector<std::vector<Eigen::Vector2d>> stars;  // offsets, same order as stems
  double l0_m = 0.0;                                // mean distance of natural neighbours
};
[[nodiscard]] StarView stars_of(const SparsePoints& level_view);

// What differs between two views of the same neighbourhood.
struct StarNoise {
  double stem_sd_m = 0.1;  // of a stem's place within a view, per axis
  double seen = 0.6;  // probability that a neighbour is seen, and is one, in the other view too
};

// Probabilistic data association of two views' stems. Two stems are the same with the probability
// that place (uncertain by `guess_variance_m2` per axis) and star speak for it. Against it stand
// all others within reach, and that there is none. Returned is the number of stems whose partner is
// known, the sum of squared probabilities: a stem that could be either of two counts half. Heights
// do not count. Thread-safe.
[[nodiscard]] double associated_stems(const StarView& target, const StarView& source,
                                      const Pose& target_from_source, double guess_variance_m2,
                                      const StarNoise& noise);

}  // namespace understory
