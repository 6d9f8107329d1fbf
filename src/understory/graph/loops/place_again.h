#pragma once

#include <Eigen/Core>

#include "understory/geometry/points.h"
#include "understory/graph/loops/loop_closure.h"
#include "understory/registration/global/search_cloud.h"

namespace understory {

// A place of a map whose position against other places is not known.
struct UnplacedCloud {
  Points points;  // body frame of its keyframe, metres; best a small map of keyframes around it
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  // in that frame, unit
  SearchCloud ready;  // the points with z up, made ready for a match without a guess
};
[[nodiscard]] UnplacedCloud make_unplaced(Points points, const Eigen::Vector3d& up);

// Whether two clouds show one place, without a guess. Their motion is found by upright things and
// NDT (registration/global), and the verdict on such matches has to trust it. From that pose on it
// is verified as every loop is (verify_loop). `reason` of the result says what failed. Pure;
// parallel inside; same bits for any number of threads.
[[nodiscard]] LoopVerification verify_place_again(const UnplacedCloud& target,
                                                  const UnplacedCloud& source,
                                                  const LoopClosureConfig& config);

}  // namespace understory
