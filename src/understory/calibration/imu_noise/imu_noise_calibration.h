#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "understory/calibration/imu_noise/allan_deviation.h"
#include "understory/calibration/imu_noise/noise_fit.h"
#include "understory/calibration/imu_noise/standing_watch.h"
#include "understory/sensor/imu_sample.h"

namespace understory {

// The noise of a sensor of three axes in the frame of the IMU.
struct SensorNoise {
  std::array<std::vector<AllanPoint>, 3> curves;  // x, y, z
  std::array<AxisNoise, 3> axes;
};

// The noise of an IMU that stood still.
struct ImuNoise {
  SensorNoise gyroscope;      // rad/s
  SensorNoise accelerometer;  // m/s^2
  TimeNs from = 0;
  TimeNs to = 0;
  double rate_hz = 0.0;  // mean over the recording
  std::uint64_t samples = 0;
  Eigen::Vector3d mean_rate = Eigen::Vector3d::Zero();   // rad/s
  Eigen::Vector3d mean_force = Eigen::Vector3d::Zero();  // m/s^2
  // What falls short, a sentence each: figures that the recording is too short for, lost samples.
  std::vector<std::string> shortcomings;
  [[nodiscard]] double duration_s() const { return to_seconds(to - from); }
};

// Why samples tell no noise figures.
enum class ImuNoiseProblem { kNone, kNoSamples, kMoves, kTooShort };

// What came of a calibration: `noise` where there is no problem.
struct ImuNoiseResult {
  ImuNoiseProblem problem = ImuNoiseProblem::kNone;
  std::string reason;  // a sentence with times and lengths; empty without a problem
  ImuNoise noise;
};

// Noise figures of an IMU by the Allan variance of a recording in which it stands still (P2), its
// samples one after another. Memory does not grow with the recording. Not thread-safe.
class ImuNoiseCalibration {
 public:
  // The next sample. One that is not after the last one is passed over.
  void add(const ImuSample& sample);
  // What all samples so far say. A recording that moves at any time, has a gap, or lasts less than
  // a minute is a problem. `origin` is the time from which the reason counts seconds.
  [[nodiscard]] ImuNoiseResult result(TimeNs origin) const;

 private:
  [[nodiscard]] std::string standstill_text(TimeNs origin) const;

  std::array<AllanDeviation, 6> deviations_;  // gyroscope, accelerometer
  StandingWatch watch_;
  Eigen::Matrix<double, 6, 1> sum_ = Eigen::Matrix<double, 6, 1>::Zero();
  std::vector<TimeNs> intervals_;  // the first ones
  TimeNs first_ = 0;
  TimeNs last_ = 0;
  std::uint64_t samples_ = 0;
};

}  // namespace understory
