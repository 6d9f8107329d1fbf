#pragma once

#include "understory/geometry/pose.h"
#include "understory/util/time.h"

namespace understory {

// The pose of the body at one time.
struct StampedPose {
  TimeNs stamp = 0;
  Pose world_from_body;
};

}  // namespace understory
