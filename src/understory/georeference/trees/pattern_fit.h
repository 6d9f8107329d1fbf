#pragma once

#include <Eigen/Core>
#include <vector>

#include "understory/georeference/trees/pattern_grid.h"
#include "understory/georeference/trees/place_search.h"

namespace understory {

// How a source lies best on a target near a start, and how likely it is there.
struct PatternFit {
  PlaneMotion target_from_source;
  TreeLikeness likeness;  // with the noise and the share that fit
  // Logarithm of the likelihood ratio: trees of one stand against trees that lie so by chance.
  double score = 0.0;
  double matched = 0.0;  // trees of the source with a tree of the target, by probability
  double covered = 0.0;  // trees of the source that lie where the target reaches
  // Inverse covariance of turn, x and y, the turn about the source's origin: rad, m, m. What is
  // lost because partners are uncertain is taken off (T. A. Louis, 1982).
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
};

// Expectation maximisation from a start that is off by a metre or so. Each tree of the source is
// either one of the trees of the target near it, displaced by noise, or none of them. Then the
// trees there are as dense as around. Noise and share are fitted, too. Deterministic.
[[nodiscard]] PatternFit fit_pattern(const std::vector<PatternTree>& source,
                                     const PatternGrid& target, const PlaneMotion& start,
                                     const TreeLikeness& likeness, int steps);

// The same likelihood ratio from the other side. Each tree of the target that lies in the source's
// area is one of its trees, or none. It tells more where the source has nearly all trees: then a
// tree of the target without a partner speaks against the place. `source` lies as in the fit.
[[nodiscard]] double reverse_score(const PatternGrid& source, const PatternGrid& target,
                                   const PatternFit& fit);

}  // namespace understory
