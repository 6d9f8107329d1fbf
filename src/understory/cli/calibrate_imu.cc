#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "understory/calibration/imu_noise/imu_noise_calibration.h"
#include "understory/cli/calibrate.h"
#include "understory/cli/open_options.h"
#include "understory/cli/outcome.h"
#include "understory/pipeline/calibration/imu_noise_files.h"
#include "understory/pipeline/source.h"
#include "understory/util/error.h"
#include "understory/util/files/staged_output.h"

namespace understory {
namespace {

constexpr double kToTheEnd = 1e9;  // s

struct CalibrateImuOptions {
  std::string recording;
  std::string folder;
  OpenOptions open;
  double from_s = 0.0;
  double to_s = kToTheEnd;
  double factor = 3.0;
  bool overwrite = false;
  bool json = false;
};

nlohmann::ordered_json sensor_json(const SensorNoise& sensor) {
  nlohmann::ordered_json json;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto figure = [](const NoiseFigure& f) {
      return nlohmann::ordered_json{
          {"value", f.value}, {"sd", f.sd}, {"found", f.found}, {"limit", f.limit}};
    };
    const AxisNoise& noise = sensor.axes[axis];
    json[std::string(1, "xyz"[axis])] = {{"white_noise", figure(noise.white)},
                                         {"bias_instability", figure(noise.instability)},
                                         {"random_walk", figure(noise.walk)}};
  }
  return json;
}

std::string to_json(const ImuNoise& noise) {
  const nlohmann::ordered_json json = {
      {"status", noise.shortcomings.empty() ? "complete" : "partial"},
      {"reasons", noise.shortcomings},
      {"duration_s", noise.duration_s()},
      {"rate_hz", noise.rate_hz},
      {"samples", noise.samples},
      {"gyroscope_rad_s", sensor_json(noise.gyroscope)},
      {"accelerometer_m_s2", sensor_json(noise.accelerometer)}};
  return json.dump(2);
}

std::string figure_text(const NoiseFigure& figure) {
  return figure.found ? fmt::format("{:.3g} ± {:.1g}", figure.value, figure.sd)
                      : fmt::format("below {:.2g}", figure.limit);
}

std::string sensor_text(const char* name, const char* unit, const SensorNoise& sensor) {
  std::string text = fmt::format("{}\n", name);
  const auto line = [&](const char* figure, const char* of_unit, NoiseFigure AxisNoise::*member) {
    text += fmt::format("  {:<18} {:<16}", figure, std::string(unit) + of_unit);
    for (const AxisNoise& axis : sensor.axes)
      text += fmt::format("  {:<22}", figure_text(axis.*member));
    text.erase(text.find_last_not_of(' ') + 1);
    text += '\n';
  };
  line("white noise", "/sqrt(Hz)", &AxisNoise::white);
  line("bias instability", "", &AxisNoise::instability);
  line("random walk", "/s/sqrt(Hz)", &AxisNoise::walk);
  return text;
}

std::string to_text(const ImuNoise& noise, const std::string& folder) {
  return fmt::format("{:.1f} s standing still, {} samples at {:.1f} Hz; figures of x, y, z\n",
                     noise.duration_s(), noise.samples, noise.rate_hz) +
         sensor_text("gyroscope", "rad/s", noise.gyroscope) +
         sensor_text("accelerometer", "m/s^2", noise.accelerometer) +
         fmt::format("settings: {0}/imu.yaml\nplots: {0}/imu_noise.html", folder);
}

// Reads the samples between the two times; seconds count from the first sample.
ImuNoiseResult read_noise(const CalibrateImuOptions& options, CommandContext& context) {
  const std::unique_ptr<Recording> recording =
      open_source(options.recording, options.open, context.log);
  const ProgressSink progress = context.until_stopped();
  ImuNoiseCalibration calibration;
  std::optional<TimeNs> origin;
  std::uint64_t events = 0;
  while (const auto event = recording->next()) {
    if (++events % 256 == 0) progress({"reading", 100.0 * recording->progress(), 100.0, "%", ""});
    const auto* sample = std::get_if<ImuSample>(&*event);
    if (sample == nullptr) continue;
    if (!origin) origin = sample->stamp;
    const double at = to_seconds(sample->stamp - *origin);
    if (at < options.from_s) continue;
    if (at > options.to_s) break;
    calibration.add(*sample);
  }
  return calibration.result(origin.value_or(0));
}

int calibrate_imu(const CalibrateImuOptions& options, CommandContext& context) {
  if (options.from_s >= options.to_s)
    throw ConfigError({"--to-s: expected a time after that of --from-s"});
  refuse_run_over_inputs(options.folder, options.recording, options.open, {});
  StagedFolder folder(options.folder, options.overwrite ? StagedFolder::NameTest(is_imu_noise_file)
                                                        : StagedFolder::NameTest());
  const ImuNoiseResult result = read_noise(options, context);
  if (result.problem != ImuNoiseProblem::kNone) {
    const bool moves = result.problem == ImuNoiseProblem::kMoves;
    throw InputError(options.recording, "",
                     result.reason + (moves ? " (--from-s and --to-s choose a part)" : ""));
  }
  write_imu_noise(folder.part(), result.noise, {options.recording, options.factor});
  folder.commit();
  return report_outcome(
      options.json ? to_json(result.noise) : to_text(result.noise, options.folder),
      result.noise.shortcomings.empty() ? RunStatus::kComplete : RunStatus::kPartial,
      result.noise.shortcomings);
}

}  // namespace

void add_calibrate_imu_command(CLI::App& calibrate, Command& chosen) {
  CLI::App* command = calibrate.add_subcommand(
      "imu", "Noise of an IMU by the Allan variance of a recording in which it stands still");
  const auto options = std::make_shared<CalibrateImuOptions>();
  command
      ->add_option("RECORDING", options->recording,
                   "File or folder with an IMU that stands still, or sim:still?duration_s=3600")
      ->required();
  command
      ->add_option("-o,--output", options->folder,
                   "Folder for imu.yaml, imu_noise.csv, allan.csv and imu_noise.html")
      ->required();
  command->add_option("--from-s", options->from_s, "Seconds since the first sample to begin at")
      ->check(CLI::Range(0.0, kToTheEnd));
  command->add_option("--to-s", options->to_s, "Seconds since the first sample to end at")
      ->check(CLI::Range(0.0, kToTheEnd));
  command
      ->add_option("--factor", options->factor,
                   "The settings of imu.yaml are so many times the figures, because a carried IMU "
                   "is shaken")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  command->add_flag("--overwrite", options->overwrite, kOverwriteMeaning);
  command->add_flag("--json", options->json, "One JSON object on stdout");
  add_open_options(*command, options->open);
  command->footer(
      "Let the IMU stand on firm ground for an hour or more, without an engine or a fan.\n\n"
      "Example:\n  understory calibrate imu still.mcap -o noise\n"
      "  understory map walk.mcap -o plot7 --config noise/imu.yaml");
  command->callback([options, &chosen] {
    chosen = [options](CommandContext& context) { return calibrate_imu(*options, context); };
  });
}

}  // namespace understory
