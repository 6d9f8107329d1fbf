#include "understory/pipeline/georeferencing/placement_methods.h"
#include "understory/pipeline/georeferencing/tree_placement.h"

namespace understory {

Placement place_by_trees(const GeoreferenceRequest& request, const MovableRun& run, Log& log) {
  const FoundTrees found = find_trees(request, run, rough_place(request, run, log), log);
  Placement placement;
  placement.target_from_world = found.match.target_from_source;
  placement.origin = found.target.origin;
  tell_trees(request, run, found, placement);
  return placement;
}

}  // namespace understory
