#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/sensor/tree.h"
#include "understory/util/progress.h"

namespace understory {

// How a map of trees is found again in another one, by the pattern of the trees alone.
struct TreeMatchConfig {
  // Of the source, about: the search takes the largest of a compact part of the map.
  std::size_t most_trees = 200;
  double noise_m = 0.75;  // of the difference of two places of one tree, along each axis, about
  double share = 0.6;     // of the source's trees that the target has, too, about
  // A place is trusted only if chance gives one as good less often than this, among all the places
  // and headings that were tried.
  double most_chance = 1e-3;
};

// Where the source may lie: `source_point` of the source lies within a disc of the target, at any
// heading. Metres.
struct TreeSearchArea {
  Eigen::Vector2d source_point = Eigen::Vector2d::Zero();
  Eigen::Vector2d target_point = Eigen::Vector2d::Zero();
  double radius_m = 200.0;
};

// Two trees that are one: indices into source and target.
struct MatchedTrees {
  std::size_t source = 0;
  std::size_t target = 0;
  double apart_m = 0.0;  // in the plane, after the match
};

// Where a map of trees lies in another one. Metres.
struct TreeMatch {
  bool found = false;  // there is a best place; it need not be right
  bool trusted = false;
  std::string reason;       // why it is not found or not trusted, for the user
  Pose target_from_source;  // turned about z; the height by the feet of matched trees, else 0
  // Of turn, x and y about `centre`: rad, m, m, target frame.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  Eigen::Vector2d centre_in_source = Eigen::Vector2d::Zero();
  std::vector<MatchedTrees> pairs;   // one to one, in the order of the source
  std::size_t searched_trees = 0;    // of the source, that the search went by
  std::size_t covered_trees = 0;     // of the source, that lie where the target has trees
  double expected_by_chance = 0.0;   // of the pairs, at a place without a common tree
  double noise_m = 0.0;              // of the difference of two places of one tree, along each axis
  double apart_rms_m = 0.0;          // of the pairs, in the plane
  std::size_t heights_compared = 0;  // pairs whose feet have a height in both maps
  double height_sd_m = 0.0;          // of the shift in height; NaN where there is none
  // Logarithms of likelihood ratios: of the best place, and of the best other one.
  double score = 0.0;
  double rival_score = 0.0;
  double poses_tried = 0.0;  // that differ by more than the noise
  double chance = 1.0;       // that one of so many places is so good without a common tree
};

// Finds `source` in `target` at any heading, without a guess. It tries all headings and places of
// the area on a grid (place_search.h), and refines the best ones (pattern_fit.h). It judges the
// best of all by two chances. One is how rarely trees without relation reach its likelihood ratio,
// the other how far it stands out from the other places. Sizes help where both maps have heights or
// both have diameters. Trees with a position that is not finite are passed over.
//
// Not found where either map has too few trees or the area holds none. Deterministic, the same for
// any number of threads. Polls `progress`, and throws nothing else.
[[nodiscard]] TreeMatch match_tree_maps(std::span<const Tree> source, std::span<const Tree> target,
                                        const TreeSearchArea& area, const TreeMatchConfig& config,
                                        const ProgressSink& progress = {});

}  // namespace understory
