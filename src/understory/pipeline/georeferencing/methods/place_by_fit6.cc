#include <fmt/format.h>

#include <filesystem>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "understory/georeference/satellites/satellite_smoothing.h"
#include "understory/pipeline/georeferencing/methods/placement_methods.h"
#include "understory/pipeline/georeferencing/methods/satellite_placement.h"
#include "understory/pipeline/run_folder/run_json.h"
#include "understory/pipeline/source.h"
#include "understory/util/error.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

// What an IMU measured on the way of a run.
struct InertialData {
  std::vector<ImuSample> samples;
  Pose body_from_imu;
};

// The recording that the run's run.json names, if it is still there.
std::string recording_of(const fs::path& run) {
  for (const std::string& file : RunJson(run).find_texts_of("/inputs", "file"))
    if (fs::exists(file)) return file;
  return "";
}

InertialData read_inertial(const std::string& name, Log& log) {
  const auto recording = open_source(name, {}, log);
  InertialData data;
  while (const auto event = recording->next()) {
    if (const auto* sample = std::get_if<ImuSample>(&*event)) data.samples.push_back(*sample);
  }
  if (data.samples.empty())
    throw InputError(name, "", "expected samples of an IMU: method fit6 smooths the fixes with it");
  if (!recording->rig().body_from_imu)
    throw InputError(name, "", "expected the place of the IMU on the carrier");
  data.body_from_imu = *recording->rig().body_from_imu;
  return data;
}

}  // namespace

Placement place_by_fit6(const GeoreferenceRequest& request, const MovableRun& run, Log& log) {
  const SatelliteInput input = read_satellite_input(request, run, log);
  const std::string name =
      request.recording.empty() ? recording_of(request.run) : request.recording;
  if (name.empty())
    throw InputError(request.run.string(), "",
                     "expected --recording: a run holds no samples of its IMU, and the recording "
                     "that run.json names is not there");
  const SatelliteFit start =
      fit_to_satellites(run.trajectory, input.fixes, SatelliteMethod::kSplit, input.config);
  if (!start.found) return placement_of(request, run, input, start, "fit6", log);
  const InertialData data = read_inertial(name, log);
  SatelliteSmoothingConfig smoothing;
  smoothing.pairing = input.config.pairing;
  smoothing.body_from_imu = data.body_from_imu;
  const std::vector<SmoothedPose> smoothed =
      smooth_satellites(run.trajectory, input.fixes, data.samples, start.enu_from_world, smoothing);
  if (smoothed.empty())
    throw InputError(name, "", "expected samples of the IMU at the times of the fixes and the run");
  const SatelliteFit fit = fit_to_satellites(run.trajectory, input.fixes, SatelliteMethod::kFit6,
                                             input.config, smoothed);
  Placement placement = placement_of(request, run, input, fit, "fit6", log);
  placement.figures["smoothed_poses"] = static_cast<std::int64_t>(smoothed.size());
  placement.summary += fmt::format("\n{} poses smoothed with the IMU of {}", smoothed.size(), name);
  return placement;
}

}  // namespace understory
