#pragma once

#include <Eigen/Core>

#include "understory/georeference/systems/geodetic.h"

namespace understory::test {

// For tests: where a run starts, and the antenna on a mast in the frame of the body, m.
inline const GeodeticPlace kPlace{61.2, 25.1, 160.0};
inline const Eigen::Vector3d kArm(0.2, -0.3, 2.0);

}  // namespace understory::test
