#pragma once

#include <vector>

#include "understory/pipeline/georeferencing/georeferencing.h"
#include "understory/pipeline/georeferencing/methods/placement.h"
#include "understory/pipeline/georeferencing/movable_run.h"
#include "understory/util/log.h"

namespace understory {

// One way to find the place of a run. A new method is its own file and one line of the list.
struct PlacementMethod {
  GeoreferenceMethod method;
  const char* name;     // as on the command line
  const char* meaning;  // for --help
  // Throws InputError where the method cannot be used on this input.
  Placement (*place)(const GeoreferenceRequest& request, const MovableRun& run, Log& log);
};

// All of them, in the order of --help.
[[nodiscard]] const std::vector<PlacementMethod>& placement_methods();

// georeferencing/methods/place_by_auto.cc: the fit with the smallest expected error.
[[nodiscard]] Placement place_by_best(const GeoreferenceRequest& request, const MovableRun& run,
                                      Log& log);
// georeferencing/methods/place_by_all.cc: by fixes, a map of trees and a terrain model together, as
// far as the request names them.
[[nodiscard]] Placement place_by_all(const GeoreferenceRequest& request, const MovableRun& run,
                                     Log& log);
// georeferencing/methods/place_by_satellites.cc: fits by the times of the fixes.
[[nodiscard]] Placement place_by_closed_form(const GeoreferenceRequest& request,
                                             const MovableRun& run, Log& log);
[[nodiscard]] Placement place_by_fit3(const GeoreferenceRequest& request, const MovableRun& run,
                                      Log& log);
[[nodiscard]] Placement place_by_split(const GeoreferenceRequest& request, const MovableRun& run,
                                       Log& log);
// georeferencing/methods/place_by_fit6.cc: poses from positions and IMU.
[[nodiscard]] Placement place_by_fit6(const GeoreferenceRequest& request, const MovableRun& run,
                                      Log& log);
// georeferencing/methods/place_by_points.cc: control points.
[[nodiscard]] Placement place_by_points(const GeoreferenceRequest& request, const MovableRun& run,
                                        Log& log);
// georeferencing/methods/place_by_gnss_path.cc: P1 (6).
[[nodiscard]] Placement place_by_gnss_path(const GeoreferenceRequest& request,
                                           const MovableRun& run, Log& log);
// georeferencing/methods/place_by_terrain.cc: P1 section 3, table 1.
[[nodiscard]] Placement place_by_terrain(const GeoreferenceRequest& request, const MovableRun& run,
                                         Log& log);

// georeferencing/methods/place_by_trees.cc: by the pattern of the trees alone.
[[nodiscard]] Placement place_by_trees(const GeoreferenceRequest& request, const MovableRun& run,
                                       Log& log);

}  // namespace understory
