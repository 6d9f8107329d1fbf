#include <cmath>

#include "understory/pipeline/georeferencing/methods/placement_methods.h"
#include "understory/pipeline/georeferencing/methods/terrain_placement.h"
#include "understory/util/error.h"

namespace understory {
namespace {

// Where only height and tilt are fitted, place and heading stay as sure as they were.
void keep_certainty(const MovableRun& run, Placement& placement) {
  if (std::isfinite(run.expected_error_m)) {
    placement.expected_error_m = run.expected_error_m;
    placement.figures["expected_error_m"] = run.expected_error_m;
  }
  if (std::isfinite(run.heading_sd_deg)) placement.figures["sd_heading_deg"] = run.heading_sd_deg;
}

}  // namespace

Placement place_by_terrain(const GeoreferenceRequest& request, const MovableRun& run,
                           Log& /*log*/) {
  if (!request.start && !run.origin)
    throw InputError(request.run.string(), "",
                     "where the run lies on the terrain model is not known. Lay it on a GNSS path "
                     "first, or give --start (0 0 0 if its frame is that of the model)");
  Pose placed = run.enu_from_world;
  Placement placement;
  if (request.start) {
    const auto& [x_m, y_m, yaw_deg] = *request.start;
    placed = Pose(
        Eigen::Quaterniond(Eigen::AngleAxisd(yaw_deg * M_PI / 180.0, Eigen::Vector3d::UnitZ())),
        Eigen::Vector3d(x_m, y_m, 0.0));
  } else {
    placement.origin = run.origin;
    if (request.terrain.place_sd_m == 0.0 && request.terrain.yaw_sd_deg == 0.0)
      keep_certainty(run, placement);
  }
  const LevelledRun levelled = level_run(request, run, placed, placement.origin, request.terrain);
  placement.target_from_world = levelled.target_from_world;
  tell_levelled(request, levelled, placement);
  return placement;
}

}  // namespace understory
