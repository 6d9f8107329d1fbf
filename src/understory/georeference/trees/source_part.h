#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "understory/georeference/trees/pattern_grid.h"
#include "understory/sensor/tree.h"

namespace understory {

// A compact part of a map of trees. Metres.
struct SourcePart {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  // in the map's frame
  std::vector<PatternTree> trees;                    // relative to the centre
  double reach_m = 0.0;                              // of the farthest from the centre
};

// Of the trees `indices`, those that a map of `density` trees per square metre would show. They are
// the tallest, or the thickest without heights, or all without both. From below one sees thin trees
// under the crowns, which the air does not show. In the order of `indices`.
[[nodiscard]] std::vector<std::size_t> dominant_trees(std::span<const Tree> trees,
                                                      const std::vector<std::size_t>& indices,
                                                      double density);

// Up to `count` parts of about `most` trees each: first the most compact one, then those far from
// the parts before. All trees in one part where they are no more than that.
[[nodiscard]] std::vector<SourcePart> parts_of(const std::vector<PatternTree>& trees,
                                               std::size_t most, std::size_t count);

}  // namespace understory
