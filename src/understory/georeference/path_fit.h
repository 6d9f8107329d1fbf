#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>
#include <vector>

#include "understory/geometry/pose.h"

namespace understory {

// Fit of an odometry path to a GNSS path by one rigid motion in the plane, P1 (6). It needs no
// common clock, only the same way. Nearest points are taken both ways, so that neither path can
// hide in a part of the other.
struct PathFitConfig {
  // As printed every pair counts alike, and a receiver that ran away for a minute draws the path
  // along. Robust: pairs count by Tukey's biweight, whose width comes from the pairs themselves.
  bool robust = true;
  int yaw_starts = 36;  // headings that the search begins from
  // Only motions that turn by this, or by 90 degrees more or less; not finite: any.
  double about_yaw_rad = std::numeric_limits<double>::quiet_NaN();
};

// The motion in the plane between a path and GNSS fixes, P1 (6), and how well it fits. Metres.
struct PathFit {
  bool found = false;
  std::string reason;  // if not
  // To the GNSS's frame; the heights stay.
  Pose target_from_source;
  double symmetric_rms_m = 0.0;  // root of the minimum of (6), all pairs alike
  double fixes_rms_m = 0.0;      // of the fixes to their nearest point of the path
  double fixes_mean_m = 0.0;
  double fixes_median_m = 0.0;
  double path_rms_m = 0.0;  // of the path's points to their nearest fix
  double path_mean_m = 0.0;
  std::vector<double> fix_distance_m;  // one per fix
  std::vector<char> fix_used;          // 0: so far off that it was not used (robust only)
  // Root of (6) at the best motion that is turned by more than 20 degrees from this one. A straight
  // path fits the other way round as well.
  double turned_rms_m = 0.0;
  Pose turned_target_from_source;
  // Standard deviation of the heading that the fixes leave, degrees, at most 90. It comes from how
  // (6) rises when the path turns, its residuals, and the number of independent fixes.
  double heading_sd_deg = 0.0;
};

// Only x and y are looked at. Metres. Deterministic; thread-safe. Not found where either path has
// fewer than three points or is shorter than 5 m.
[[nodiscard]] PathFit fit_path(const std::vector<Eigen::Vector3d>& path,
                               const std::vector<Eigen::Vector3d>& fixes,
                               const PathFitConfig& config);

}  // namespace understory
