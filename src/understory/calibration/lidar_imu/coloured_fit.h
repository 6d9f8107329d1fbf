#pragma once

#include "understory/calibration/lidar_imu/path_and_imu.h"

namespace understory {

// Normal equations of a least-squares fit: the step is -information^-1 gradient.
struct NormalEquations {
  LidarImuMatrix information = LidarImuMatrix::Zero();
  LidarImuStep gradient = LidarImuStep::Zero();
};

// Adds a sequence of residuals of three axes, or of one, whose errors are correlated over time by a
// law that nobody knows. Errors of scan matching swing with gait and turns, and those of
// neighbouring differences cancel. Residuals and derivatives are taken apart into frequencies.
// Errors of different frequencies are nearly independent, and their variance is that of the
// residuals at the frequencies around (Hannan 1963). At least 20 residuals of each axis.
void add_coloured(const PathResiduals& residuals, NormalEquations& equations);

}  // namespace understory
