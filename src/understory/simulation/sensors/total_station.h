#pragma once

#include <Eigen/Core>
#include <vector>

#include "understory/simulation/world.h"
#include "understory/util/time.h"

namespace understory {

// What a total station measured of the prism at one moment, in the world frame.
struct PrismSample {
  TimeNs stamp = 0;
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
};

// Where the prism truly is. Its link turns with the body but takes over only a part of its tilt (a
// levelled cabin on soft mounts). Thread-safe.
[[nodiscard]] Eigen::Vector3d prism_in_world(const TotalStationConfig& config,
                                             const CarrierPath& path, double time_s);

// The reference of P4 section 4.1.5. A total station on the road behind the route's start follows
// the prism, where nothing stands in its line of sight. It has its own rate and its own errors of
// set-up, distance, angle and clock. Lost from sight, it needs a while to find the prism again.
// Samples of [0, until_s) of the path, in order; `start` is the time of the path's zero. Leaves the
// scene at another moment than before. Empty if the site has none.
[[nodiscard]] std::vector<PrismSample> track_prism(SimulatedWorld& world, TimeNs start,
                                                   double until_s);

}  // namespace understory
