#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "understory/georeference/satellites/satellite_fit.h"
#include "understory/pipeline/georeferencing/georeferencing.h"
#include "understory/pipeline/georeferencing/methods/placement.h"
#include "understory/pipeline/georeferencing/movable_run.h"
#include "understory/util/log.h"

namespace understory {

// What the fits to satellite positions of one call have in common.
struct SatelliteInput {
  std::filesystem::path file;  // of the fixes
  std::vector<GnssFix> fixes;
  SatelliteFitConfig config;
};

// How far the run's up may be off gravity, degrees: --tilt-sd-deg. Without it, whether the run had
// an IMU or was laid on the earth before decides.
[[nodiscard]] double tilt_sd_deg(const GeoreferenceRequest& request, const MovableRun& run);

// Where the antenna of the fixes is in the body frame, metres. The request says it, or run.json for
// the run's own fixes; else it is the body's origin. Warns of one that is far off.
[[nodiscard]] Eigen::Vector3d antenna_of(const GeoreferenceRequest& request, const MovableRun& run,
                                         Log& log);

// Reads the fixes and settles the settings of the fits: a run that was mapped with an IMU is level.
// Warns of a lever arm that is no lever arm, and of headings without the antennas' places. Throws
// InputError.
[[nodiscard]] SatelliteInput read_satellite_input(const GeoreferenceRequest& request,
                                                  const MovableRun& run, Log& log);

// Warns of headings of a second antenna that contradict the positions. A wrong place of an antenna,
// or antennas that are swapped, must not turn the map in silence.
void warn_of_headings(const UsedHeadings& headings, Log& log);

// A fit as the placement of a run, with figures, doubts and the fixes as used. Throws InputError
// where the fit was not found or the angles of the fixes are swapped.
[[nodiscard]] Placement placement_of(const GeoreferenceRequest& request, const MovableRun& run,
                                     const SatelliteInput& input, const SatelliteFit& fit,
                                     const std::string& method, Log& log);

}  // namespace understory
