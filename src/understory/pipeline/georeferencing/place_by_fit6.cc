#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "understory/georeference/satellites/satellite_smoothing.h"
#include "understory/pipeline/georeferencing/placement_methods.h"
#include "understory/pipeline/georeferencing/satellite_placement.h"
#include "understory/pipeline/source.h"
#include "understory/util/error.h"
#include "understory/util/files/text_file.h"

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
  if (!fs::exists(run / "run.json")) return "";
  const auto json = nlohmann::json::parse(read_text_file(run / "run.json"), nullptr, false);
  if (json.is_discarded() || !json.is_object() || !json.contains("inputs")) return "";
  for (const auto& input : json["inputs"]) {
    if (!input.is_object() || !input.contains("file") || !input["file"].is_string()) continue;
    const auto file = input["file"].get<std::string>();
    if (fs::exists(file)) return file;
  }
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
