#pragma once

#include <vector>

#include "understory/map/felled_trees.h"
#include "understory/util/time.h"

namespace understory {

// Where a harvester's head was when it cut a tree off its stump.
struct HeadCut {
  TimeNs stamp = 0;
  Eigen::Vector3d head_in_world = Eigen::Vector3d::Zero();  // metres
};

// The tree of a sparse map that stood where the head cut one.
struct CutTree {
  int tree = -1;  // index into the map; -1: none of the map stood there
  double distance_m = 0.0;
};

// When a cut of the harvester's head belongs to a tree.
struct CutMatching {
  double reach_m = 1.0;    // from the head to the tree's axis, in the plane
  double settle_s = 30.0;  // a cut tree may be seen at its place for so long, held by the head
};

// The tree of each cut, each tree at most once, nearest pairs first. A tree that was seen at its
// place later than the cut is none, unless `felled` says that it was gone by then. `seen` are the
// times of the views. Deterministic; thread-safe.
[[nodiscard]] std::vector<CutTree> match_cuts(const std::vector<HeadCut>& cuts,
                                              const std::vector<MappedStem>& trees,
                                              const std::vector<FelledTree>& felled,
                                              const std::vector<StemView>& views,
                                              const CutMatching& config);

}  // namespace understory
