#pragma once

#include <vector>

#include "understory/geometry/pose.h"
#include "understory/map/stem_map.h"
#include "understory/sensor/stem_view.h"

namespace understory {

// A tree of a sparse map that stood and is gone.
struct FelledTree {
  std::size_t tree = 0;  // index into the map
  int last_seen = 0;     // views: it fell between these
  int first_missed = 0;
  int missed = 0;  // views near enough, nothing before it, that should have seen it and did not
};

// When a tree that is no longer seen counts as gone. Metres.
struct FelledConfig {
  double reach_m = 15.0;     // farther sights and misses tell nothing
  double nearest_m = 1.5;    // nor do those that the machine itself may hide
  int min_seen = 3;          // within reach, before it was gone
  int min_missed = 9;        // within reach, from then on: misses in a row are not independent
  double chance = 1e-4;      // that a standing tree is missed as often in a row
  double clearance_m = 0.3;  // a stem that near to the line of sight may hide it
  // Misses tell only in views that stand that near to one that saw the tree; 0: all of them.
  double same_place_m = 0.0;

  // Where nobody fells. Undergrowth that is no stem hides a tree from one side and not from the
  // other. So only a view from where the tree was seen before tells that it is gone.
  [[nodiscard]] static FelledConfig unattended();
};

// Trees that were seen as a rule until some view and never again. Later views had them in their
// sector, near and with no other stem before them. How often a tree is missed as a rule is taken
// from the views before. Views are in the order of time. Deterministic; thread-safe.
[[nodiscard]] std::vector<FelledTree> felled_trees(const std::vector<StemView>& views,
                                                   const std::vector<Pose>& world_from_body,
                                                   const std::vector<MappedStem>& trees,
                                                   const FelledConfig& config);

}  // namespace understory
