#pragma once

#include <Eigen/Core>
#include <vector>

#include "understory/calibration/imu_noise/allan_deviation.h"

namespace understory {

// One figure of a sensor's noise.
struct NoiseFigure {
  double value = 0.0;  // not negative
  double sd = 0.0;     // standard deviation; for a figure that is not found, of no use
  bool found = false;  // it differs from zero by two standard deviations
  double limit = 0.0;  // the figure is below, with 97.5 %
};

// The noise of one axis of an IMU, in the unit u of its signal (rad/s or m/s^2).
struct AxisNoise {
  NoiseFigure white;        // density of white noise, u/sqrt(Hz): angle or velocity random walk
  NoiseFigure instability;  // bias instability, u: the floor of the Allan deviation / 0.664
  NoiseFigure walk;         // density of the bias's random walk, u/s/sqrt(Hz)
};

// Allan variances that white noise, bias instability and random walk of size 1 have at an averaging
// time in seconds: 1/t, 2 ln(2)/pi, t/3.
[[nodiscard]] Eigen::RowVector3d allan_variances_of_unit_noise(double time_s);

// Allan deviation that the figures make at an averaging time in seconds, in the unit of the signal.
[[nodiscard]] double fitted_deviation(const AxisNoise& noise, double time_s);

// Fits the three figures to a curve by P2's Allan variance method. They are those whose sum makes
// the measured variances the likeliest. Each variance has the chi-squared distribution with as many
// degrees of freedom as windows of its averaging time follow one another. Standard deviations count
// that variances at different averaging times are not independent. `duration_s`: of the signal.
// Averaging times below 0.1 s are left out. Throws InternalError for fewer than three others.
[[nodiscard]] AxisNoise fit_noise(const std::vector<AllanPoint>& curve, double duration_s);

}  // namespace understory
