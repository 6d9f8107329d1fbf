#pragma once

#include <limits>
#include <vector>

#include "understory/forest/trees/tree_owners.h"
#include "understory/geometry/plane/plot_shape.h"

namespace understory {

// The crown of a tree, from the cubes that belong to it. NaN where none was seen. Area and volume
// are also NaN, and the outline is empty, where it was seen from one side only. The base is NaN
// where the tree is wide down to 1.5 m: below, nothing tells its branches from undergrowth.
struct TreeCrown {
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

  double base_m = kUnknown;     // above the ground: where the layers become wide, over 1.5 m
  double area_m2 = kUnknown;    // of its outline seen from above
  double volume_m3 = kUnknown;  // sum of the outlines of its layers
  // 1: its upper half shows a stem and nothing beside it, as a snag does; 0: it has branches.
  double bare = kUnknown;
  PlaneRing outline;  // seen from above: convex, against the clock, metres
};

// Base, area and volume of each crown. The area is that of the convex outline, without what sticks
// out far. The outlines of the layers are made of sixteen wedges. Nearly all cubes of each of
// sixteen directions lie within. What few cubes miss of the edge is added to both.
[[nodiscard]] std::vector<TreeCrown> measure_crowns(const TreeOwners& owners,
                                                    const std::vector<OwnerTree>& trees);

}  // namespace understory
