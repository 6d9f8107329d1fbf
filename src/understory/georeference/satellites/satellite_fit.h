#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "understory/geometry/stamped_pose.h"
#include "understory/georeference/satellites/gnss_fit.h"
#include "understory/georeference/satellites/rigid_fits.h"
#include "understory/georeference/satellites/satellite_pairs.h"
#include "understory/georeference/satellites/split_fit.h"
#include "understory/georeference/systems/geodetic.h"
#include "understory/sensor/gnss_fix.h"

namespace understory {

// How a run is laid on fixes by their times.
enum class SatelliteMethod {
  kClosed,  // closed form, all pairs alike; P4 T5 "closed"
  kFit3,    // positions with their covariances, P4 (43, 44)
  kFit6,    // poses: fixes smoothed with the IMU, P4 (45-52)
  kSplit    // each degree of freedom by what knows it best, P4 section 5.3
};

// A pose of the body that fixes and IMU give together, in the frame of the pairs.
struct SmoothedPose {
  TimeNs stamp = 0;
  Pose enu_from_body;
  Matrix6d covariance = Matrix6d::Identity();  // right perturbation, rotation first
};

// Settings of the fits of a path to fixes.
struct SatelliteFitConfig {
  PairingConfig pairing;
  SplitFitConfig split;
  RigidFitConfig rigid;
  // Error of the run's own places, one standard deviation of each axis, for (44) and (47).
  double path_sd_m = 0.05;
  double path_sd_deg = 0.1;
  // Residuals over the extent of the path beyond which fixes are not of it [chosen].
  double most_misfit = 0.4;
};

// A run laid on fixes, and how far it may be off.
struct SatelliteFit {
  bool found = false;
  std::string reason;  // if not
  std::optional<GeodeticPlace> origin;
  Pose enu_from_world;
  Matrix6d covariance = Matrix6d::Zero();  // right perturbation, rotation first
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  Matrix6d spread = Matrix6d::Zero();  // about `middle`, see SplitFit
  double expected_error_m = 0.0;       // root mean square over the poses of the path
  bool height_known = false;
  // Fix minus antenna at its time, root mean square over the pairs that count.
  double plane_rms_m = 0.0;
  double height_rms_m = 0.0;
  double all_plane_rms_m = 0.0;  // the same over all pairs
  double left_out_share = 0.0;   // of the pairs: far off the others
  // What the receiver's errors look like: NaN in height where no fix has one.
  double plane_noise_m = 0.0;
  double height_noise_m = 0.0;
  double correlation_s = 0.0;
  double independent_fixes = 0.0;  // with independent errors that know the place as well
  double time_offset_s = 0.0;      // found; 0 where it was not looked for
  double time_offset_sd_s = 0.0;
  std::size_t fixes_in_time = 0;
  // Latitude and longitude of the fixes fit the path better when they are swapped.
  bool swapped = false;
  std::vector<FittedFix> fixes;          // all of them
  std::optional<UsedHeadings> headings;  // of a second antenna; kSplit alone uses them
};

// Lays a path on fixes by several methods, a fit each. `smoothed` is for kFit6 only. Not found
// where no fix is of the path's time, the path spans too little, or the method needs heights and
// there are none. The covariance is that of the method under errors that are correlated in time,
// whose size the residuals tell. Deterministic; thread-safe.
[[nodiscard]] std::vector<SatelliteFit> fits_to_satellites(
    const std::vector<StampedPose>& trajectory, const std::vector<GnssFix>& fixes,
    const std::vector<SatelliteMethod>& methods, const SatelliteFitConfig& config,
    const std::vector<SmoothedPose>& smoothed = {});
// By one method.
[[nodiscard]] SatelliteFit fit_to_satellites(const std::vector<StampedPose>& trajectory,
                                             const std::vector<GnssFix>& fixes,
                                             SatelliteMethod method,
                                             const SatelliteFitConfig& config,
                                             const std::vector<SmoothedPose>& smoothed = {});

}  // namespace understory
