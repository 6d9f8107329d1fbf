#pragma once

#include <Eigen/Core>

#include "understory/sensor/gnss_fix.h"

namespace understory {

// What a fix says of its own error. Metres, one standard deviation.
struct FixCovarianceConfig {
  // Error of a position for a dilution of precision of one [chosen: code positions under trees].
  double sd_per_dop_m = 1.5;
  double default_plane_sd_m = 2.0;   // each axis, of a fix that says nothing [chosen]
  double default_height_sd_m = 4.0;  // of a fix that says nothing [chosen]
  double least_sd_m = 0.01;          // no fix is better [bound: GNSS]
};

// Covariance of a fix, east, north, up, m^2. It is the receiver's own where that is one (finite,
// positive on its diagonal, no correlation beyond one). Else it comes from HDOP and VDOP as in P2
// section 3, else it is the default. HDOP is of both axes of the plane together. Receivers under
// trees promise too much: the fits estimate one more factor for all fixes.
[[nodiscard]] Eigen::Matrix3d fix_covariance(const GnssFix& fix, const FixCovarianceConfig& config);

}  // namespace understory
