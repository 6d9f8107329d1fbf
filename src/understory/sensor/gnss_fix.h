#pragma once

#include <Eigen/Core>
#include <limits>

#include "understory/util/time.h"

namespace understory {

// One GNSS position. Angles in degrees as receivers report them, WGS 84, ellipsoidal height.
struct GnssFix {
  TimeNs stamp = 0;
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;
  double height_m = 0.0;  // above the ellipsoid
  // East, north, up; m^2. All NaN where the receiver gives none.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN());
  int quality = 0;      // 0 no fix, 1 autonomous, 2 differential, 4 RTK fixed, 5 RTK float
  int satellites = -1;  // -1 unknown
  double hdop = std::numeric_limits<double>::quiet_NaN();
  double vdop = std::numeric_limits<double>::quiet_NaN();
  double track_deg = std::numeric_limits<double>::quiet_NaN();  // clockwise from true north
  double speed_m_s = std::numeric_limits<double>::quiet_NaN();
  // Heading of the line from this antenna to a second one, clockwise from true north, 0 to 360, and
  // its standard deviation. NaN: there is none; the receiver does not say how good it is.
  double heading_deg = std::numeric_limits<double>::quiet_NaN();
  double heading_sd_deg = std::numeric_limits<double>::quiet_NaN();
};

}  // namespace understory
