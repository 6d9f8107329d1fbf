#include <cmath>

#include "understory/georeference/satellites/split_fit.h"
#include "understory/pipeline/georeferencing/methods/placement_methods.h"
#include "understory/pipeline/georeferencing/methods/satellite_placement.h"
#include "understory/pipeline/georeferencing/methods/tree_placement.h"

namespace understory {

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
  }
  tell_trees(request, found, placement);
  return placement;
}

}  // namespace understory
