#pragma once

#include <Eigen/Core>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/georeference/systems/geodetic.h"
#include "understory/output/run_summary.h"
#include "understory/output/run_tables.h"
#include "understory/util/error.h"

namespace understory {

// What one thing that a run was laid on (a control point, a tree) lies off its place in the run.
struct PlacementResidual {
  std::string name;
  Eigen::Vector3d residual_in_target =  // its place minus the moved one, metres; NaN: not known
      Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  bool used = true;
  std::string reason;  // why not used
};

// How a run is to be moved, and what to say of it. Every method of `georeference` returns one.
struct Placement {
  Pose target_from_world;
  std::string method;  // that found it, as on the command line; `auto` names the one it chose
  // Of a right perturbation of target_from_world, rotation before translation (rad, m). NaN where
  // the method does not tell it.
  Matrix6d covariance = Matrix6d::Constant(std::numeric_limits<double>::quiet_NaN());
  // Error of a place on the path that the covariance makes one expect, root mean square over the
  // poses, metres. NaN where it is not known.
  double expected_error_m = std::numeric_limits<double>::quiet_NaN();
  std::vector<PlacementResidual> residuals;  // of things other than fixes
  std::optional<GeodeticPlace> origin;       // of the target frame, where that is east, north, up
  std::string heights;  // what they count from, where it is not the ellipsoid and no fix says so
  std::vector<InputHash> inputs;          // files that it was computed from, beside the run's own
  std::vector<GnssRow> gnss;              // the fixes as used, for gnss.csv
  std::map<std::string, Figure> figures;  // for run.json
  std::string summary;                    // a few lines for the terminal
  std::vector<std::string> doubts;        // why the result is untrusted

  void doubt(const std::string& reason) { doubts.push_back(reason); }
};

// Beginnings of what a run says of heights that are not above the ellipsoid.
inline constexpr const char* kHeightsOfModel = "as the terrain model counts them";
inline constexpr const char* kHeightsOfOrigin = "above the origin of the run";
// What an error says, without the file that it names first.
[[nodiscard]] std::string reason_of(const InputError& error);
// What heights are above where it is not the ellipsoid: no fix may have a height, nor the map of
// trees. Else empty.
[[nodiscard]] std::string other_heights(const Placement& placement);
// Standard deviation of the heading, degrees; NaN where the method does not tell it.
[[nodiscard]] double heading_sd_deg(const Placement& placement);

}  // namespace understory
