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
#include "understory/pipeline/georeferencing/run_place.h"
#include "understory/pipeline/run_folder/run_outcome.h"
#include "understory/util/log.h"
#include "understory/util/progress.h"

namespace understory {

// What a map is laid on.
enum class GeoreferenceMethod {
  kAuto,      // the one of the following with the smallest expected error
  kSplit,     // each degree of freedom by what knows it best, P4 section 5.3
  kClosed,    // closed form, P4 table 5
  kFit3,      // positions with their covariances, P4 (43, 44)
  kFit6,      // poses: positions smoothed with the IMU, P4 (45-52)
  kPoints,    // surveyed control points
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
  // Of the receiver or of what stood on the points; not given: that of the run's own receiver.
  std::optional<Eigen::Vector3d> antenna_in_body;
  std::optional<Eigen::Vector3d> second_antenna_in_body;  // needs the first one's
  std::string recording;          // whose IMU smooths the fixes; empty: as run.json names it
  std::filesystem::path points;   // table of control points
  double time_offset_s = 0.0;     // added to the stamps of the fixes
  double time_offset_sd_s = 0.0;  // and how far it may be off; 0 holds it
  // How far the run's up may be off gravity; not given: by whether it was mapped with an IMU.
  std::optional<double> tilt_sd_deg;
  PathFitConfig path;
  std::filesystem::path terrain_model;
  // Where the run's origin lies on a terrain model without a coordinate system (x, y, metres). The
  // third is the direction of its x axis, degrees anticlockwise from east.
  std::optional<std::array<double, 3>> start;
  TerrainFitConfig terrain;
  // A map of trees, or a cloud from the air in which tops are found.
  std::filesystem::path tree_map;
  std::string tree_map_system;  // of a tree map that states none
  // Where the middle of the run's trees lies about, in the tree map's coordinates.
  std::optional<Eigen::Vector2d> near;
  double near_radius_m = 200.0;  // how far off that may be
  TreeMatchConfig trees;
  GeoreferenceConfig layers;  // their coordinate system
  ProgressSink progress;      // polled by the methods; run_georeferencing sets it
};

// What `understory georeference` tells when it is done.
struct GeoreferenceOutcome : RunOutcome {
  std::map<std::string, Figure> figures;
};

// Moves a finished run by a fit. It reads trajectory.tum and what else can be moved of the run
// folder, and writes all of it, moved, to another folder. Throws InputError, OutputError or
// ConfigError, and Stopped where the user stops it: the folder of the result is as it was.
[[nodiscard]] GeoreferenceOutcome run_georeferencing(const GeoreferenceRequest& request, Log& log,
                                                     const ProgressSink& progress = {});

}  // namespace understory
