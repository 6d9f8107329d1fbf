#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "understory/evaluation/trajectory.h"
#include "understory/georeference/satellites/split_fit.h"
#include "understory/output/report/report.h"
#include "understory/pipeline/georeferencing/georeferencing.h"
#include "understory/pipeline/georeferencing/methods/placement.h"
#include "understory/pipeline/georeferencing/run_place.h"
#include "understory/sensor/gnss_fix.h"
#include "understory/util/log.h"

namespace understory {

// A run that was mapped just now, before its layers are written.
struct MappedPath {
  std::filesystem::path results;  // folder that holds its trajectory.tum
  const Trajectory& trajectory;   // world frame
  const std::vector<GnssFix>& fixes;
  std::optional<Eigen::Vector3d> antenna_in_body = {};  // metres; nothing where unknown
  std::optional<Eigen::Vector3d> second_antenna_in_body = {};
  LevelledBy levelled_by = LevelledBy::kNothing;
};

// Where it lies on the globe.
struct PlacedMap {
  ResultFrames frames;  // the world frame where it has no place
  RunPlace place;
  std::map<std::string, Figure> figures;  // of the fit, for run.json
  std::vector<ReportFix> fixes;           // world frame
};

// A placement by the recording's own fixes, or why there is none.
struct FoundPlacement {
  std::optional<Placement> placement;
  std::string reason;
};

// Those of `all` whose latitude and longitude are a place on the earth.
[[nodiscard]] std::vector<GnssFix> fixes_with_position(const std::vector<GnssFix>& all);

// By a method that needs nothing but fixes. Writes gnss.csv, which the placement names as its
// input. Throws OutputError.
[[nodiscard]] FoundPlacement find_placement(const MappedPath& run, const GeoreferenceConfig& config,
                                            GeoreferenceMethod method, Log& log);
// Lays a run on the globe. Writes gnss.csv, with the fixes in the run's world frame and what became
// of each. Where there are no fixes, or the fit is not to be trusted, the layers stay in the world
// frame, with the reason. Where there are fixes a warning says so. The run's status does not depend
// on it. Throws OutputError.
[[nodiscard]] PlacedMap place_map(const MappedPath& run, const FoundPlacement& found,
                                  const GeoreferenceConfig& config, Log& log);
// Both, by the method `auto`.
[[nodiscard]] PlacedMap place_map(const MappedPath& run, const GeoreferenceConfig& config,
                                  Log& log);

}  // namespace understory
