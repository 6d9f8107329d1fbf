#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "understory/evaluation/trajectory.h"
#include "understory/georeference/geodetic.h"
#include "understory/georeference/path_fit.h"
#include "understory/output/run_summary.h"
#include "understory/output/run_tables.h"
#include "understory/sensor/gnss_fix.h"
#include "understory/util/log.h"

namespace understory {

// The fixes of a file: an NMEA log, a table with timestamp, latitude_deg and longitude_deg
// (gnss.csv of a run or of a folder of clouds), or any recording. Those without a position are left
// out. Throws InputError where there are none.
[[nodiscard]] std::vector<GnssFix> read_fixes(const std::string& file, Log& log);

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
  std::vector<GnssRow> rows;  // for gnss.csv, positions in the frame east, north, up
};

// `antenna_in_body` is the lever arm, zero where unknown.
[[nodiscard]] GnssFit fit_to_gnss(const Trajectory& trajectory,
                                  const Eigen::Vector3d& antenna_in_body,
                                  const std::vector<GnssFix>& fixes, const PathFitConfig& config);

// For run.json: gnss_fit_rms_m and the like; empty if there was no fit.
[[nodiscard]] std::map<std::string, Figure> figures_of(const GnssFit& fit);

}  // namespace understory
