#include "understory/pipeline/georeferencing/methods/placement_methods.h"
#include "understory/pipeline/georeferencing/methods/satellite_placement.h"

namespace understory {
namespace {

Placement place_by(SatelliteMethod method, const char* name, const GeoreferenceRequest& request,
                   const MovableRun& run, Log& log) {
  const SatelliteInput input = read_satellite_input(request, run, log);
  const SatelliteFit fit = fit_to_satellites(run.trajectory, input.fixes, method, input.config);
  return placement_of(request, run, input, fit, name, log);
}

}  // namespace

Placement place_by_closed_form(const GeoreferenceRequest& request, const MovableRun& run,
                               Log& log) {
  return place_by(SatelliteMethod::kClosed, "closed", request, run, log);
}

Placement place_by_fit3(const GeoreferenceRequest& request, const MovableRun& run, Log& log) {
  return place_by(SatelliteMethod::kFit3, "fit3", request, run, log);
}

Placement place_by_split(const GeoreferenceRequest& request, const MovableRun& run, Log& log) {
  return place_by(SatelliteMethod::kSplit, "split", request, run, log);
}

}  // namespace understory
