#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>
#include <vector>

#include "understory/geometry/stamped_pose.h"
#include "understory/georeference/path_fit.h"
#include "understory/georeference/systems/geodetic.h"
#include "understory/sensor/gnss_fix.h"

namespace understory {

// A fix and the path that was laid on it. Frame east, north, up at the first fix, metres.
struct FittedFix {
  GnssFix fix;
  Eigen::Vector3d position_in_enu =
      Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  // Fix minus antenna at its time; NaN where the path does not tell.
  Eigen::Vector3d residual = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  bool used = false;  // false: too far from the path, without a weight
};

// A path laid on a GNSS path, P1 (6), in the frame east, north, up at the first fix.
struct GnssFit {
  PathFit path;  // of the antenna
  std::optional<GeodeticPlace> origin;
  Pose enu_from_world;  // with the height from the medians of both, where the fixes have heights
  bool turned_by_time = false;  // (6) fits as well the other way round; the clocks told which
  bool ambiguous = false;       // the same, and the clocks tell nothing
  // Where both have the same clock: fix minus antenna along and across the way, root mean square.
  std::size_t fixes_in_time = 0;
  double along_rms_m = 0.0;
  double across_rms_m = 0.0;
  std::vector<FittedFix> fixes;  // all of them; none where no fit was found
};

// `trajectory` is in order of time; `antenna_in_body` is the lever arm, zero where unknown.
// Deterministic; thread-safe. Not found (`path.found`) as fit_path.
[[nodiscard]] GnssFit fit_to_gnss(const std::vector<StampedPose>& trajectory,
                                  const Eigen::Vector3d& antenna_in_body,
                                  const std::vector<GnssFix>& fixes, const PathFitConfig& config);

// Heading of a motion's x axis about z, radians.
[[nodiscard]] double yaw_of(const Pose& pose);

}  // namespace understory
