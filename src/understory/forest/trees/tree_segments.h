#pragma once

#include <Eigen/Core>
#include <vector>

#include "understory/forest/ground/ground.h"
#include "understory/forest/point_blocks.h"
#include "understory/sensor/tree.h"

namespace understory {

// The points of one tree and what stands within a step of it, for a look at how sharp the map is
// (P4-9, P4 figs. 9-12).
struct TreeSegment {
  int tree_id = 0;
  // x, y relative to the stem's foot, metres; z above the ground. Thinned.
  std::vector<Eigen::Vector3f> points;
};

// One more run through the cloud. Takes at most `most` of the trees with a diameter, spread evenly
// over it; `reach_m` is half the width of the square around a foot.
[[nodiscard]] std::vector<TreeSegment> collect_segments(const PointBlocks& cloud,
                                                        const GroundModel& ground,
                                                        const std::vector<Tree>& trees, int most,
                                                        double reach_m);

}  // namespace understory
