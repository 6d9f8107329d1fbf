#pragma once

#include <optional>

#include "understory/georeference/combined_place.h"
#include "understory/georeference/systems/geodetic.h"
#include "understory/georeference/trees/tree_match.h"
#include "understory/pipeline/georeferencing/georeferencing.h"
#include "understory/pipeline/georeferencing/methods/placement.h"
#include "understory/pipeline/georeferencing/methods/tree_target.h"
#include "understory/pipeline/georeferencing/movable_run.h"
#include "understory/util/log.h"

namespace understory {

// A place of the run whose place on the earth is about known.
struct RoughPlace {
  Eigen::Vector2d point_in_world = Eigen::Vector2d::Zero();  // metres
  GeodeticPlace place;
  std::optional<double> radius_m;  // how far off it may be; not given: as the request says
};

// The run's trees in a map of trees.
struct FoundTrees {
  TreeTarget target;
  TreeMatch match;
  bool by_tops = false;          // of the run's canopy; else by its stems
  std::size_t trees_of_run = 0;  // stems or tops that were given to the search
};

// From an earlier fit, else from the fixes of the run; nothing where there are none.
[[nodiscard]] std::optional<RoughPlace> rough_place(const GeoreferenceRequest& request,
                                                    const MovableRun& run, Log& log);

// The middle of the run's trees, by medians; metres, world frame.
[[nodiscard]] Eigen::Vector2d middle_of_trees(const MovableRun& run);

// Looks for the run's trees near a rough place, or wherever the request says. It compares its stems
// and, where it has a canopy model, its tops. The likelier of both is the result. Throws InputError
// where the run has too few trees, the map none near the place, or no place is found at all.
[[nodiscard]] FoundTrees find_trees(const GeoreferenceRequest& request, const MovableRun& run,
                                    const std::optional<RoughPlace>& rough, Log& log);

// Figures, summary and inputs of a match.
void tell_trees(const GeoreferenceRequest& request, const FoundTrees& found, Placement& placement);

// What a match tells of the place: heading and the plane, and the height where `heights`.
[[nodiscard]] PlaceEvidence evidence_of_trees(const MovableRun& run, const TreeMatch& match,
                                              bool heights);
// How level a run is that lies at `target_from_world`.
[[nodiscard]] PlaceEvidence evidence_of_gravity(const Pose& target_from_world,
                                                const Eigen::Vector3d& middle, double tilt_sd_deg);

}  // namespace understory
