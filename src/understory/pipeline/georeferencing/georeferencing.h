#pragma once

#include <Eigen/Core>
#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "understory/georeference/path_fit.h"
#include "understory/georeference/terrain_fit.h"
#include "understory/georeference/trees/tree_match.h"
#include "understory/output/run_summary.h"
#include "understory/pipeline/run_folder/run_outcome.h"
#include "understory/util/log.h"

namespace understory {

// What a map is laid on.
enum class GeoreferenceMethod {
  kGnssPath,  // one motion in the plane between two paths, P1 (6)
  kTerrain,   // one rigid motion that lays ground points on a terrain model, P1 table 1
  kTrees      // turn and shift by which the trees are found in a map of trees
};

// One call of `understory georeference`.
struct GeoreferenceRequest {
  std::filesystem::path run;  // folder with trajectory.tum
  std::filesystem::path result;
  bool overwrite = false;  // what an earlier run left in the folder of the result
  GeoreferenceMethod method = GeoreferenceMethod::kGnssPath;
  std::string gnss;  // file with fixes; empty: gnss.csv of the run
  Eigen::Vector3d antenna_in_body = Eigen::Vector3d::Zero();
  PathFitConfig path;
  std::filesystem::path terrain_model;
  // Where the run's origin lies on a terrain model without a coordinate system: x, y, metres, and
  // the direction of its x axis, degrees anticlockwise from east.
  std::optional<std::array<double, 3>> start;
  TerrainFitConfig terrain;
  // A map of trees, or a cloud from the air in which tops are found.
  std::filesystem::path tree_map;
  std::string tree_map_system;  // of a tree map that states none
  // Where the middle of the run's trees lies about, in the tree map's coordinates.
  std::optional<Eigen::Vector2d> near;
  double near_radius_m = 200.0;  // how far off that may be
  TreeMatchConfig trees;
  std::string coordinate_system;  // of trees.gpkg; empty: the UTM zone
};

// What `understory georeference` tells when it is done.
struct GeoreferenceOutcome : RunOutcome {
  std::map<std::string, Figure> figures;
};

// Moves a run by a fit after it was made: reads trajectory.tum and what else can be moved of the
// run folder and writes all of it, moved, to another one. Throws InputError, OutputError or
// ConfigError.
[[nodiscard]] GeoreferenceOutcome run_georeferencing(const GeoreferenceRequest& request, Log& log);

}  // namespace understory
