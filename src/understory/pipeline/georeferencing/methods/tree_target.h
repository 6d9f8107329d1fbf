#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "understory/georeference/systems/geodetic.h"
#include "understory/sensor/tree.h"
#include "understory/util/log.h"
#include "understory/util/progress.h"

namespace understory {

// How a map of trees is read and searched.
struct TreeTargetConfig {
  double widest_search_m = 1500.0;  // radius that is searched without a rough position
  double narrowest_m = 5.0;         // a map that is narrower is in degrees
  double farthest_m = 1e6;          // from zero; coordinates of a local frame lie nearer
  double canopy_cell_m = 0.5;       // of the canopy in which tops of a cloud are found
  double tallest_m = 80.0;          // above the ground; higher returns are no trees
};

// The map of trees in which a run is looked for.
struct TreeTarget {
  // Metres. East, north, up at `origin` where the file has a coordinate system, else its own frame.
  // z is the ground, NaN where it is not known.
  std::vector<Tree> trees;
  std::optional<GeodeticPlace> origin;
  bool from_cloud = false;              // tops that were found in a cloud
  std::optional<Eigen::Vector2d> near;  // the rough position in this frame, where one was given
  Eigen::Vector2d low = Eigen::Vector2d::Zero();  // the box around the trees
  Eigen::Vector2d high = Eigen::Vector2d::Zero();
};

// Reads a map of trees, or finds the tops in a cloud from the air. `system` is the coordinate
// system of a file that states none. `near` is a place in the file's coordinates. `place` is where
// the run is known to be: the frame's origin then. Polls `progress`. Throws InputError or
// ConfigError.
[[nodiscard]] TreeTarget read_tree_target(const std::filesystem::path& path,
                                          const std::string& system,
                                          const std::optional<Eigen::Vector2d>& near,
                                          const std::optional<GeodeticPlace>& place,
                                          const TreeTargetConfig& config, Log& log,
                                          const ProgressSink& progress);

}  // namespace understory
