#include <cmath>

#include "understory/georeference/satellites/split_fit.h"
#include "understory/georeference/systems/geodetic.h"
#include "understory/pipeline/georeferencing/methods/placement_methods.h"
#include "understory/pipeline/georeferencing/methods/satellite_placement.h"
#include "understory/pipeline/georeferencing/methods/tree_placement.h"

namespace understory {

namespace {

// A map without ground leaves heights as they are: those of the run's place, where it has one. Else
// they count from the run's own origin, and a warning says so.
void keep_heights(const MovableRun& run, Placement& placement, Log& log) {
  if (!placement.origin) return;
  if (!run.origin) {
    placement.heights = std::string(kHeightsOfOrigin) + ", as the map of trees has no heights";
    log.warn("georeference.local_heights",
             "neither the map of trees nor the run tells heights: those of the layers count from "
             "the origin of the run");
    return;
  }
  for (const char* others : {kHeightsOfModel, kHeightsOfOrigin})
    if (run.heights.starts_with(others)) placement.heights = run.heights;
  const Eigen::Vector2d middle = middle_of_trees(run);
  const Eigen::Vector3d at(middle.x(), middle.y(), 0.0);
  const double before = EastNorthUp(*run.origin).to_place(run.enu_from_world * at).height_m;
  const Pose& motion = placement.target_from_world;
  const double after = EastNorthUp(*placement.origin).to_place(motion * at).height_m;
  placement.target_from_world =
      Pose(motion.rotation(), motion.translation() + Eigen::Vector3d(0.0, 0.0, before - after));
}

}  // namespace

Placement place_by_trees(const GeoreferenceRequest& request, const MovableRun& run, Log& log) {
  const FoundTrees found = find_trees(request, run, rough_place(request, run, log), log);
  Placement placement;
  placement.target_from_world = found.match.target_from_source;
  placement.origin = found.target.origin;
  if (std::isfinite(found.match.height_sd_m)) {
    const PlaceEvidence trees = evidence_of_trees(run, found.match, true);
    const CombinedPlace place =
        combine_places({trees, evidence_of_gravity(trees.target_from_world, trees.middle,
                                                   tilt_sd_deg(request, run))});
    placement.covariance = right_from_spread(place.spread, place.target_from_world, place.middle);
  } else {
    keep_heights(run, placement, log);
  }
  tell_trees(request, found, placement);
  return placement;
}

}  // namespace understory
