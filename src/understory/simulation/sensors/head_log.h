#pragma once

#include <Eigen/Core>
#include <vector>

#include "understory/simulation/world.h"
#include "understory/util/time.h"

namespace understory {

// What a harvester's computer notes when its head cuts a tree off the stump.
struct HeadCutSample {
  TimeNs stamp = 0;
  Eigen::Vector3d head_in_body = Eigen::Vector3d::Zero();  // metres
};

// The felling cuts of [0, until_s) of the path, in order, with the errors of the site's head_log;
// `start` is the time of the path's zero. Empty for what fells no trees. Thread-safe.
[[nodiscard]] std::vector<HeadCutSample> log_head_cuts(const SimulatedWorld& world, TimeNs start,
                                                       double until_s);

}  // namespace understory
