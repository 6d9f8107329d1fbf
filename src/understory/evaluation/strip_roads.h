#pragma once

#include <Eigen/Core>
#include <string>
#include <utility>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/map/stem_map.h"
#include "understory/sensor/stem_view.h"

namespace understory {

// Self-consistency of strip roads, P1 (10) and table 1: trees mapped from one road alone against
// those mapped from a neighbouring road alone.
struct StripRoadConfig {
  double min_length_m = 50.0;  // of a straight stretch to count as a road
  double smoothed_m = 10.0;    // way over which the heading of the path is taken
  double straight_deg = 30.0;  // a road's heading stays that near
  double farthest_m = 40.0;    // between neighbouring roads
  double within_m = 15.0;      // trees that near to both roads are compared; see below
  double pairing_m = 0.3;      // of trees that count as the same
  double part_m = 50.0;        // length of the parts
  StemMapConfig map;
};

// Views of a straight stretch of the path.
struct StripRoad {
  std::size_t first = 0;  // indices of views, both included
  std::size_t last = 0;
};
[[nodiscard]] std::vector<StripRoad> find_strip_roads(const std::vector<Pose>& world_from_body,
                                                      const StripRoadConfig& config);

// How well the trees seen from two neighbouring roads agree, P1 (10).
struct RoadConsistency {
  std::size_t road = 0;  // numbers of the two roads, in the order of the path
  std::size_t other = 0;
  std::size_t trees = 0;
  std::size_t trees_other = 0;
  double as_placed = 0.0;    // c, both where the trajectory places them
  double moved = 0.0;        // after the one motion in the plane that fits best
  double in_parts = 0.0;     // after a motion for each part, mean weighted by trees
  double match_rms_m = 0.0;  // of the trees that are the same, as placed
};

// All pairs of neighbouring roads. Compared are the trees that lie within `within_m` of the line
// half way between the roads, and beside both. Both roads can have seen those, from 20 to 30 m.
// Trees that were felled between the passes count against it.
[[nodiscard]] std::vector<RoadConsistency> road_consistencies(
    const std::vector<StemView>& views, const std::vector<Pose>& world_from_body,
    const StripRoadConfig& config);

}  // namespace understory
