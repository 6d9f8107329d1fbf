#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "understory/evaluation/trajectory.h"
#include "understory/output/report.h"
#include "understory/pipeline/georeferencing/run_place.h"
#include "understory/sensor/gnss_fix.h"
#include "understory/util/log.h"

namespace understory {

// A run that was mapped just now, before its layers are written.
struct MappedPath {
  std::filesystem::path results;  // folder that holds its trajectory.tum
  const Trajectory& trajectory;   // world frame
  const std::vector<GnssFix>& fixes;
  Eigen::Vector3d antenna_in_body = Eigen::Vector3d::Zero();  // metres; zero where unknown
  bool level = false;  // it was mapped with an IMU: its up is that of gravity
};

// Where it lies on the globe.
struct PlacedMap {
  ResultFrames frames;  // the world frame where it has no place
  RunPlace place;
  std::map<std::string, Figure> figures;  // of the fit, for run.json
  std::vector<ReportFix> fixes;           // world frame
};

// Finds the place of a run by the recording's own fixes, by the method `auto` where there is one.
// Writes gnss.csv, with the fixes in the run's world frame and what became of each. Where there are
// no fixes, or the fit is not to be trusted, the layers stay in the world frame, with the reason;
// where there are fixes a warning says so. The run's status does not depend on it. Throws
// OutputError.
[[nodiscard]] PlacedMap place_map(const MappedPath& run, const GeoreferenceConfig& config,
                                  Log& log);

}  // namespace understory
