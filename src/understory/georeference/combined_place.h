#pragma once

#include <Eigen/Core>
#include <vector>

#include "understory/geometry/pose.h"

namespace understory {

// What one source (fixes, a map of trees) knows of where a run lies.
struct PlaceEvidence {
  Pose target_from_world;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();  // a place near the run, target frame, metres
  // Inverse covariance of a small turn about the target's axes through `middle` (rad), then a shift
  // (m). Rows and columns of what the source does not tell are 0.
  Matrix6d information = Matrix6d::Zero();
};

// Where a run lies by all sources together.
struct CombinedPlace {
  Pose target_from_world;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();  // that of the first source
  Matrix6d spread = Matrix6d::Zero();  // covariance of a turn through `middle`, then a shift
  // Sum over the sources of the squared distance from what each says, in standard deviations: chi
  // squared. It has as many degrees of freedom as the sources tell, less six.
  double disagreement = 0.0;
};

// The most probable motion where the errors of the sources are independent. Each source fixes the
// degrees of freedom that it knows (P4 section 5.3 and its future work). What no source tells stays
// as the first one has it, with a spread of kilometres. `sources` must not be empty.
[[nodiscard]] CombinedPlace combine_places(const std::vector<PlaceEvidence>& sources);

// The information of a turn through `middle` and a shift, as that of a turn through `other`.
[[nodiscard]] Matrix6d information_about(const Matrix6d& information, const Eigen::Vector3d& middle,
                                         const Eigen::Vector3d& other);

}  // namespace understory
