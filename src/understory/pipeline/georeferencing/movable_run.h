#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "understory/evaluation/trajectory.h"
#include "understory/evaluation/tree_falls.h"
#include "understory/georeference/geodetic.h"
#include "understory/pipeline/georeferencing/placement.h"
#include "understory/pipeline/judgement/inherited_trust.h"
#include "understory/sensor/tree.h"
#include "understory/util/log.h"

namespace understory {

// What a run folder holds that a motion can move. Frame: the run's world frame, metres.
struct MovableRun {
  Trajectory trajectory;
  std::vector<Tree> trees;
  bool has_trees = false;
  std::vector<TreeFall> falls;
  bool has_falls = false;
  std::optional<GeodeticPlace> origin;  // of its frame, where that is east, north, up
  InheritedTrust trust;
};

// Throws InputError where `folder` holds no trajectory.tum.
[[nodiscard]] MovableRun read_movable_run(const std::filesystem::path& folder);

// The trees in the target frame; their standard deviations turn with the axes.
[[nodiscard]] std::vector<Tree> moved_trees(const std::vector<Tree>& trees, const Pose& motion);

// Writes every file of the run in `from`, moved, to the folder `to`. `trees` are moved already.
// `crs` is a wish, "EPSG:3067" or WKT; empty: the UTM zone. Returns the coordinate system of the
// layers, empty where the place on the globe is not known. Throws InputError, OutputError or
// ConfigError.
[[nodiscard]] std::string write_moved_run(const std::filesystem::path& from,
                                          const std::filesystem::path& to, const MovableRun& run,
                                          const Placement& placement,
                                          const std::vector<Tree>& trees, const std::string& crs,
                                          Log& log);

}  // namespace understory
