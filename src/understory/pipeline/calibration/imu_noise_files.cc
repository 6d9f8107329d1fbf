#include "understory/pipeline/calibration/imu_noise_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "understory/output/report/report_parts.h"
#include "understory/output/report/svg_plot.h"
#include "understory/util/files/atomic_file.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

constexpr const char* kImuSettingsFile = "imu.yaml";
constexpr const char* kImuFiguresFile = "imu_noise.csv";
constexpr const char* kImuCurvesFile = "allan.csv";
constexpr const char* kImuPageFile = "imu_noise.html";
constexpr const char* kAxisNames[] = {"x", "y", "z"};

// The three kinds of noise with their units behind that of the signal.
struct NoiseKind {
  const char* key;   // of imu_noise.csv
  const char* name;  // of the page
  const char* unit;
  NoiseFigure AxisNoise::*figure;
};
constexpr std::array<NoiseKind, 3> kNoiseKinds = {
    {{"white_noise", "white noise", "/sqrt(Hz)", &AxisNoise::white},
     {"bias_instability", "bias instability", "", &AxisNoise::instability},
     {"random_walk", "random walk of the bias", "/s/sqrt(Hz)", &AxisNoise::walk}}};

struct NamedSensor {
  const char* name;
  const char* unit;
  const SensorNoise* noise;
};
std::array<NamedSensor, 2> sensors_of(const ImuNoise& noise) {
  return {
      {{"gyroscope", "rad/s", &noise.gyroscope}, {"accelerometer", "m/s^2", &noise.accelerometer}}};
}

// The largest of the axes on which the figure was found; 0 for none.
double largest(const SensorNoise& sensor, NoiseFigure AxisNoise::*figure) {
  double most = 0.0;
  for (const AxisNoise& axis : sensor.axes) {
    if ((axis.*figure).found) most = std::max(most, (axis.*figure).value);
  }
  return most;
}

void write_figures(const fs::path& path, const ImuNoise& noise) {
  AtomicTextFile file(path);
  file.write("sensor,axis,figure,unit,value,sd,found,limit\n");
  for (const NamedSensor& sensor : sensors_of(noise)) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (const NoiseKind& kind : kNoiseKinds) {
        const NoiseFigure& figure = sensor.noise->axes[axis].*kind.figure;
        file.write(fmt::format("{},{},{},{}{},{:.4g},{:.2g},{},{:.4g}\n", sensor.name,
                               kAxisNames[axis], kind.key, sensor.unit, kind.unit, figure.value,
                               figure.sd, static_cast<int>(figure.found), figure.limit));
      }
    }
  }
  file.commit();
}

void write_curves(const fs::path& path, const ImuNoise& noise) {
  AtomicTextFile file(path);
  file.write("sensor,axis,averaging_time_s,deviation,fitted,pairs\n");
  for (const NamedSensor& sensor : sensors_of(noise)) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (const AllanPoint& point : sensor.noise->curves[axis])
        file.write(fmt::format("{},{},{:.6g},{:.6g},{:.6g},{}\n", sensor.name, kAxisNames[axis],
                               point.time_s, point.deviation,
                               fitted_deviation(sensor.noise->axes[axis], point.time_s),
                               point.pairs));
    }
  }
  file.commit();
}

std::string plot_of(const NamedSensor& sensor) {
  Plot plot;
  plot.x_label = "averaging time (s)";
  plot.y_label = fmt::format("Allan deviation ({})", sensor.unit);
  plot.logarithmic = true;
  plot.height = 380;
  const char* colours[] = {"var(--bad)", "var(--good)", "var(--path)"};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    PlotSeries measured{std::string(kAxisNames[axis]), colours[axis], {}, true};
    PlotSeries fitted{"", colours[axis], {}, false};
    for (const AllanPoint& point : sensor.noise->curves[axis]) {
      if (!(point.deviation > 0.0)) continue;
      measured.points.emplace_back(point.time_s, point.deviation);
      fitted.points.emplace_back(point.time_s,
                                 fitted_deviation(sensor.noise->axes[axis], point.time_s));
    }
    plot.series.push_back(measured);
    plot.series.push_back(fitted);
  }
  return svg_plot(plot);
}

std::string table_of(const NamedSensor& sensor) {
  std::string html =
      "<table><thead><tr><th>figure</th><th>unit</th><th class=\"n\">x</th><th class=\"n\">y</th>"
      "<th class=\"n\">z</th></tr></thead><tbody>";
  for (const NoiseKind& kind : kNoiseKinds) {
    html += fmt::format("<tr><td>{}</td><td>{}{}</td>", kind.name, sensor.unit, kind.unit);
    for (const AxisNoise& axis : sensor.noise->axes) {
      const NoiseFigure& figure = axis.*kind.figure;
      html += figure.found
                  ? fmt::format("<td class=\"n\">{:.3g} ± {:.1g}</td>", figure.value, figure.sd)
                  : fmt::format("<td class=\"n\">below {:.2g}</td>", figure.limit);
    }
    html += "</tr>";
  }
  return html + "</tbody></table>";
}

std::string page_of(const ImuNoise& noise, const ImuNoiseFacts& facts) {
  std::string html = fmt::format(
      "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
      "content=\"width=device-width,initial-scale=1\"><title>IMU noise: {0}</title><style>{1}"
      "</style></head><body><main><h1>IMU noise: {0}</h1><p class=\"sub\">{2} standing still, {3} "
      "samples at {4:.1f} Hz</p>",
      escape_html(facts.recording), report_style(), duration_text(noise.duration_s()),
      count_text(noise.samples), noise.rate_hz);
  if (!noise.shortcomings.empty()) {
    html += "<section class=\"verdict fair\"><h2>What falls short</h2><ul>";
    for (const std::string& sentence : noise.shortcomings)
      html += "<li>" + escape_html(sentence) + "</li>";
    html += "</ul></section>";
  }
  for (const NamedSensor& sensor : sensors_of(noise))
    html += fmt::format(
        "<section><h2>{}</h2>{}<p class=\"sub\">Dots are measured, lines are "
        "fitted.</p>{}</section>",
        sensor.name, table_of(sensor), plot_of(sensor));
  return html + "</main></body></html>\n";
}

}  // namespace

bool is_imu_noise_file(const std::string& name) {
  return name == kImuSettingsFile || name == kImuFiguresFile || name == kImuCurvesFile ||
         name == kImuPageFile;
}

std::string imu_settings_yaml(const ImuNoise& noise, const ImuNoiseFacts& facts) {
  const SensorNoise& gyro = noise.gyroscope;
  const SensorNoise& accel = noise.accelerometer;
  const std::pair<const char*, double> settings[] = {
      {"gyro_noise_rad_s_sqrt_hz", largest(gyro, &AxisNoise::white)},
      {"accel_noise_m_s2_sqrt_hz", largest(accel, &AxisNoise::white)},
      {"gyro_bias_walk_rad_s2_sqrt_hz", largest(gyro, &AxisNoise::walk)},
      {"accel_bias_walk_m_s3_sqrt_hz", largest(accel, &AxisNoise::walk)}};
  std::string lines;
  for (const auto& [key, value] : settings) {
    if (value > 0.0) lines += fmt::format("    {}: {:.4g}\n", key, facts.factor * value);
  }
  std::string yaml = fmt::format(
      "# Noise of the IMU, of its noisiest axis, times {:g}: a carried IMU is shaken.\n"
      "# understory map --config {}\n",
      facts.factor, kImuSettingsFile);
  return lines.empty() ? yaml : yaml + "motion:\n  imu:\n" + lines;
}

void write_imu_noise(const fs::path& folder, const ImuNoise& noise, const ImuNoiseFacts& facts) {
  const auto write = [&](const char* name, const std::string& text) {
    AtomicFile file(folder / name);
    file.write(text);
    file.commit();
  };
  write(kImuSettingsFile, imu_settings_yaml(noise, facts));
  write_figures(folder / kImuFiguresFile, noise);
  write_curves(folder / kImuCurvesFile, noise);
  write(kImuPageFile, page_of(noise, facts));
}

}  // namespace understory
