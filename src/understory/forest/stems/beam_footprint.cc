#include "understory/forest/stems/beam_footprint.h"

#include <algorithm>
#include <cmath>

#include "understory/forest/beam_constants.h"

namespace understory {
namespace {

using namespace beam_constants;

constexpr std::string_view kSingleRays = ", single rays";

// Three of the four lidars that are known have beams of 3 mrad.
constexpr LidarSensor kUsualSensor = LidarSensor::kVlp16;

// The beams of a sensor by its data sheet, as in simulated recordings.
BeamConfig beams_of(LidarSensor sensor) {
  switch (sensor) {
    case LidarSensor::kOs0:
      return {sensor, 6.1, 0.0, 17.0};
    case LidarSensor::kOs1:
      return {sensor, 3.0, 0.0095, 45.0};
    case LidarSensor::kVlp16:
    case LidarSensor::kVlp32:
      return {sensor, 3.0, 0.0127, 60.0};
    case LidarSensor::kRecording:
    case LidarSensor::kUnknown:
      break;
  }
  return {};
}

// Chance that what is so many times the threshold rises above it.
double risen(double times) {
  const double steep = times * times * times;
  return steep / (1.0 + steep);
}

// Chance of an echo of a beam whose middle passes `across_m` beside the centre line.
double chance_at(double across_m, double radius_m, const BeamFootprint& beam) {
  double whole = 0.0;
  double part = 0.0;
  double energy = 0.0;
  for (int k = -kBeamSteps; k <= kBeamSteps; ++k) {
    const double away = kBeamReach * k / kBeamSteps;
    const double weight = std::exp(-0.5 * away * away);
    const double place = (across_m + away * beam.sd_m) / radius_m;
    whole += weight;
    if (std::abs(place) >= 1.0) continue;
    part += weight;
    energy += weight * std::max(kLeastCosine, std::sqrt(1.0 - place * place));
  }
  return risen(part / whole / kLeastPart) * risen(beam.signal * energy / whole);
}

}  // namespace

void describe(ConfigTable& table, BeamConfig& config) {
  table.add_enum(
      "sensor", config.sensor,
      {{"recording", LidarSensor::kRecording},
       {"unknown", LidarSensor::kUnknown},
       {"OS0", LidarSensor::kOs0},
       {"OS1", LidarSensor::kOs1},
       {"VLP-16", LidarSensor::kVlp16},
       {"VLP-32C", LidarSensor::kVlp32}},
      "lidar whose wide beams the diameters are corrected for, recording: the one that the run's "
      "recording names; needs to know where it was");
  table.add("divergence_mrad", config.divergence_mrad, {0.0, 20.0}, "mrad",
            "full width of a beam, 0: that of the sensor");
  table.add("exit_m", config.exit_m, {0.0, 0.1}, "m",
            "width of a beam at the sensor, 0: that of the sensor");
  table.add(
      "reach_m", config.reach_m, {0.0, 1000.0}, "m",
      "distance at which half of the echoes of a surface of 10 % return, 0: that of the sensor");
}

LidarSensor sensor_of_model(std::string_view lidar_model) {
  // With and without the hyphen after OS; the number of rings after the next one.
  const auto is_ouster = [&](std::string_view family) {
    std::string_view rest = lidar_model;
    if (!rest.starts_with("OS")) return false;
    rest.remove_prefix(rest.starts_with("OS-") ? 3 : 2);
    if (!rest.starts_with(family)) return false;
    rest.remove_prefix(family.size());
    return rest == "-32" || rest == "-64" || rest == "-128";
  };
  if (is_ouster("0")) return LidarSensor::kOs0;
  if (is_ouster("1")) return LidarSensor::kOs1;
  if (lidar_model == "VLP-16") return LidarSensor::kVlp16;
  if (lidar_model == "VLP-32C") return LidarSensor::kVlp32;
  return LidarSensor::kUnknown;
}

BeamConfig usual_beams(std::string_view lidar_model) {
  if (lidar_model.ends_with(kSingleRays)) return {LidarSensor::kUnknown, 0.0, 0.0, 0.0};
  const LidarSensor sensor = sensor_of_model(lidar_model);
  return beams_of(sensor == LidarSensor::kUnknown ? kUsualSensor : sensor);
}

BeamFootprint footprint_at(const BeamConfig& config, double range_m) {
  const BeamConfig sheet = beams_of(config.sensor);
  const auto known = [](double given, double usual) { return given > 0.0 ? given : usual; };
  const double width = known(config.divergence_mrad, sheet.divergence_mrad);
  const double reach = known(config.reach_m, sheet.reach_m);
  if (!(range_m > 0.0) || !(width > 0.0) || !(reach > 0.0)) return {};
  return {0.25 * (known(config.exit_m, sheet.exit_m) + 1e-3 * width * range_m),
          kBark / 0.1 * reach * reach / (range_m * range_m)};
}

double mean_range_to(const std::vector<Eigen::Vector3d>& scanner, const Eigen::Vector3d& place) {
  double sum = 0.0;
  double weight = 0.0;
  for (const Eigen::Vector3d& from : scanner) {
    const double range = std::max(kNearest, (from - place).norm());
    sum += 1.0 / range;
    weight += 1.0 / (range * range);
  }
  return weight > 0.0 ? sum / weight : 0.0;
}

double excess_width_m(const BeamFootprint& beam, double radius_m) {
  if (!(beam.sd_m > 0.0) || !(radius_m > 0.0)) return 0.0;
  const double reach = radius_m + kBeamReach * beam.sd_m;
  const double step = reach / kAcrossSteps;
  double sum = 0.0;
  for (int i = 0; i < kAcrossSteps; ++i)
    sum += step * chance_at((i + 0.5) * step, radius_m, beam);
  return sum / chance_at(0.0, radius_m, beam) - radius_m;
}

double diameter_sd_m(double spread_m, double arc_deg, double range_m, const BeamFootprint& beam) {
  const double one_sided = std::max(0.0, 1.0 - arc_deg / 360.0);
  const double spread = 2.0 * spread_m;
  if (!(range_m > 0.0))
    return std::hypot(kBareSpread * spread, kBareLeastSd, kBareOneSided * one_sided);
  const double tens = 0.1 * range_m;
  if (beam.sd_m > 0.0 && beam.signal > 0.0)
    return std::hypot(std::hypot(kKnownSpread * spread, kKnownLeastSd, kKnownRangeSd * tens * tens),
                      kKnownWeakSd / beam.signal);
  return std::hypot(std::hypot(kWideSpread * spread, kWideLeastSd, kWideRangeSd * tens * tens),
                    kWideOneSided * one_sided * tens);
}

double excess_radius_m(const BeamFootprint& beam, double radius_m, double arc_deg) {
  if (!(beam.sd_m > 0.0) || !(radius_m > 0.0)) return 0.0;
  const double one_sided = std::max(0.0, 1.0 - arc_deg / 360.0);
  const double all_sides = kAllSides - kBesideStem * beam.sd_m / std::max(radius_m, kThinRadius);
  const double excess =
      one_sided * kOneSided * excess_width_m(beam, radius_m) + all_sides * beam.sd_m;
  return std::clamp(excess, -kMostShare * radius_m, kMostShare * radius_m);
}

}  // namespace understory
