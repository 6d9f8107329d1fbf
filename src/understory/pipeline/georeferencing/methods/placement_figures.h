#pragma once

#include <string>

#include "understory/evaluation/trajectory.h"
#include "understory/pipeline/georeferencing/methods/placement.h"

namespace understory {

// Adds to the figures of a placement what every method can tell. It is its motion, the expected
// error, and one standard deviation of each degree of freedom. These come from its covariance
// (turns about the east, north and up axes through the middle of the path, degrees; shifts,
// metres). Sets `expected_error_m` where the method has not.
void tell_placement(const Trajectory& trajectory, Placement& placement);

// "1.2 m east, 1.3 m north, 2.0 m up, heading 0.8 degrees, tilt 0.1 degrees" (one standard
// deviation); empty where the covariance is not known. After tell_placement.
[[nodiscard]] std::string precision_of(const Placement& placement);

}  // namespace understory
