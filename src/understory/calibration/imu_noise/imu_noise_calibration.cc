#include "understory/calibration/imu_noise/imu_noise_calibration.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "understory/calibration/calibration_constants.h"

namespace understory {

using namespace calibration_constants::imu_noise_calibration;

namespace {

SensorNoise sensor_noise(const AllanDeviation* axes, double interval_s, double duration_s) {
  SensorNoise noise;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    noise.curves[axis] = axes[axis].curve(interval_s);
    noise.axes[axis] = fit_noise(noise.curves[axis], duration_s);
  }
  return noise;
}

// The axes on which a figure is not found, as "x, y"; empty for none.
std::string axes_without(const SensorNoise& sensor, NoiseFigure AxisNoise::*figure) {
  std::string names;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if ((sensor.axes[axis].*figure).found) continue;
    names += (names.empty() ? "" : ", ") + std::string(1, "xyz"[axis]);
  }
  return names;
}

void note_missing_figures(const SensorNoise& sensor, const std::string& name, double duration_s,
                          std::vector<std::string>& shortcomings) {
  const std::pair<const char*, NoiseFigure AxisNoise::*> figures[] = {
      {"white noise", &AxisNoise::white},
      {"bias instability", &AxisNoise::instability},
      {"random walk of the bias", &AxisNoise::walk}};
  for (const auto& [figure, member] : figures) {
    const std::string axes = axes_without(sensor, member);
    if (axes.empty()) continue;
    shortcomings.push_back(
        fmt::format("{}: the {} on {} does not stand out in {:.0f} s; its limit is told", name,
                    figure, axes, duration_s));
  }
}

}  // namespace

void ImuNoiseCalibration::add(const ImuSample& sample) {
  if (samples_ > 0 && sample.stamp <= last_) return;
  if (samples_ == 0) {
    first_ = sample.stamp;
  } else if (intervals_.size() < kRateIntervals) {
    intervals_.push_back(sample.stamp - last_);
  }
  last_ = sample.stamp;
  ++samples_;
  watch_.add(sample);
  Eigen::Matrix<double, 6, 1> value;
  value << sample.angular_rate, sample.specific_force;
  sum_ += value;
  for (Eigen::Index i = 0; i < 6; ++i)
    deviations_[static_cast<std::size_t>(i)].add(value[i]);
}

std::string ImuNoiseCalibration::standstill_text(TimeNs origin) const {
  std::vector<StandingStretch> stretches = watch_.stretches();
  if (stretches.empty()) return "it stood at no time";
  const auto longest =
      std::max_element(stretches.begin(), stretches.end(),
                       [](const auto& a, const auto& b) { return a.to - a.from < b.to - b.from; });
  const std::string times =
      fmt::format("from {:.1f} s to {:.1f} s", to_seconds(longest->from - origin),
                  to_seconds(longest->to - origin));
  return stretches.size() == 1
             ? "it stood " + times
             : fmt::format("it stood {} times, longest {}", stretches.size(), times);
}

ImuNoiseResult ImuNoiseCalibration::result(TimeNs origin) const {
  ImuNoiseResult result;
  const double duration = to_seconds(last_ - first_);
  const auto refuse = [&](ImuNoiseProblem problem, const std::string& reason) {
    result.problem = problem;
    result.reason = reason;
    return result;
  };
  if (samples_ < 2) return refuse(ImuNoiseProblem::kNoSamples, "expected samples of an IMU");
  const std::vector<StandingStretch> stretches = watch_.stretches();
  if (stretches.size() != 1 || stretches[0].from != first_ || stretches[0].to != last_)
    return refuse(
        ImuNoiseProblem::kMoves,
        fmt::format("expected an IMU that stands still without a gap for all {:.1f} s; {}",
                    duration, standstill_text(origin)));
  // Samples of a minute span an interval less than it.
  if (duration + duration / static_cast<double>(samples_ - 1) < kShortestS)
    return refuse(ImuNoiseProblem::kTooShort,
                  fmt::format("expected at least {:.0f} s of standing, and hours for the "
                              "instability of the bias; found {:.2f} s",
                              kShortestS, duration));
  ImuNoise& noise = result.noise;
  noise.from = first_;
  noise.to = last_;
  noise.samples = samples_;
  noise.rate_hz = static_cast<double>(samples_ - 1) / duration;
  const double interval = 1.0 / noise.rate_hz;
  const Eigen::Matrix<double, 6, 1> mean = sum_ / static_cast<double>(samples_);
  noise.mean_rate = mean.head<3>();
  noise.mean_force = mean.tail<3>();
  noise.gyroscope = sensor_noise(deviations_.data(), interval, duration);
  noise.accelerometer = sensor_noise(deviations_.data() + 3, interval, duration);
  note_missing_figures(noise.gyroscope, "gyroscope", duration, noise.shortcomings);
  note_missing_figures(noise.accelerometer, "accelerometer", duration, noise.shortcomings);
  std::vector<TimeNs> intervals = intervals_;
  std::nth_element(intervals.begin(),
                   intervals.begin() + static_cast<std::ptrdiff_t>(intervals.size() / 2),
                   intervals.end());
  const double usual = to_seconds(intervals[intervals.size() / 2]);
  const double lost = 1.0 - usual / interval;
  if (lost > kMostLost)
    noise.shortcomings.push_back(fmt::format(
        "{:.0f} % of the samples are lost: figures are off by half of that", 100.0 * lost));
  return result;
}

}  // namespace understory
