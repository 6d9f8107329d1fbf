#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "understory/georeference/trees/pattern_grid.h"
#include "understory/util/progress.h"

namespace understory {

// A motion in the plane: turned by `yaw_rad` about the source's origin, which then lies at `at`.
struct PlaneMotion {
  double yaw_rad = 0.0;
  Eigen::Vector2d at = Eigen::Vector2d::Zero();  // metres, target frame

  [[nodiscard]] Eigen::Matrix2d rotation() const;
  [[nodiscard]] Eigen::Vector2d operator*(const Eigen::Vector2d& point_in_source) const;
};

// What is known of matching trees before the search.
struct TreeLikeness {
  double sd_m = 0.75;  // of the difference of two places of one tree, along each axis
  double share = 0.6;  // of the source's trees that the target has, too
  // Correlation of the ranks of sizes of one tree in both maps; 0: sizes are not compared.
  double rank_correlation = 0.0;

  // How many times likelier two such ranks are for one tree than for two trees by chance.
  [[nodiscard]] double rank_ratio(double source_rank, double target_rank) const;
};

// The disc in which the source's origin may lie, target frame, metres; any heading.
struct SearchDisc {
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  double radius_m = 200.0;
};

// A place that looks like the source, on the grid of the search.
struct PlaceCandidate {
  PlaneMotion target_from_source;
  double score = 0.0;  // logarithm of the likelihood ratio, about
};

// What the search found, best first, and how much it went through.
struct PlaceSearch {
  std::vector<PlaceCandidate> candidates;
  double poses = 0.0;  // that differ by more than the noise of the trees
};

// Goes through all headings and all places of the disc on a grid of 1 m. At each pose every tree of
// the source adds the logarithm of how much likelier trees of the target there are than by chance.
// This is a correlation of the source with one raster of the target. `source` lies around its
// origin. Needs trees in both. Uses all threads; the same result for any number of them. Polls
// `progress`.
[[nodiscard]] PlaceSearch search_places(const std::vector<PatternTree>& source,
                                        const PatternGrid& target, const SearchDisc& disc,
                                        const TreeLikeness& likeness,
                                        const ProgressSink& progress = {});

}  // namespace understory
