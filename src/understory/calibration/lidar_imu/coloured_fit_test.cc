#include "understory/calibration/lidar_imu/coloured_fit.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "understory/util/random.h"

namespace understory {
namespace {

// A slope in noise whose neighbours cancel: the second difference of white noise.
PathResiduals differenced(int seed, double slope) {
  Random random(static_cast<std::uint64_t>(seed), 0);
  constexpr Eigen::Index kCount = 200;
  PathResiduals residuals;
  residuals.values.resize(3 * kCount);
  residuals.by_step.resize(3 * kCount, kLidarImuParameters);
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    double last = random.normal();
    double before = random.normal();
    for (Eigen::Index i = 0; i < kCount; ++i) {
      const double next = random.normal();
      const Eigen::Index row = 3 * i + axis;
      residuals.values[row] = next - 2.0 * last + before;
      before = last;
      last = next;
      for (Eigen::Index k = 0; k < kLidarImuParameters; ++k)
        residuals.by_step(row, k) =
            std::sin(0.02 * static_cast<double>((k + 1) * i) + 0.3 * static_cast<double>(axis));
      residuals.values[row] -= slope * residuals.by_step(row, 4);
    }
  }
  return residuals;
}

TEST(ColouredFit, FindsASlopeInErrorsThatCancelFarBetterThanTheirSizeSays) {
  double squares = 0.0;
  double chi = 0.0;
  constexpr int kFits = 60;
  for (int seed = 0; seed < kFits; ++seed) {
    NormalEquations equations;
    add_coloured(differenced(seed, 0.5), equations);
    const LidarImuMatrix covariance = equations.information.inverse();
    const LidarImuStep error = -(covariance * equations.gradient) - 0.5 * LidarImuStep::Unit(4);
    squares += error[4] * error[4] / kFits;
    chi += error.dot(equations.information * error) / kLidarImuParameters / kFits;
  }
  // White noise of this size (root 6) would leave 0.14.
  EXPECT_LT(std::sqrt(squares), 0.05);
  // Never too sure of itself: what leaks from high frequencies counts as errors of the low ones.
  EXPECT_LT(chi, 1.35);
}

// A regression: the mean of differences counted as known for certain, and a calibration of a calm
// stretch became no number. Their sum is the last value less the first: its variance is that of
// two.
TEST(ColouredFit, TheMeanOfDifferencesIsKnownByTheirEndsAlone) {
  constexpr Eigen::Index kCount = 200;
  for (int seed = 0; seed < 20; ++seed) {
    Random random(static_cast<std::uint64_t>(seed), 0);
    PathResiduals residuals;
    residuals.axes = 1;
    residuals.values.resize(kCount);
    residuals.by_step.setZero(kCount, kLidarImuParameters);
    residuals.by_step.col(0).setOnes();
    double last = random.normal();
    for (Eigen::Index i = 0; i < kCount; ++i) {
      const double next = random.normal();
      residuals.values[i] = next - last;
      last = next;
    }
    NormalEquations equations;
    add_coloured(residuals, equations);
    const double known = 0.5 * kCount * kCount;  // one over the variance of the mean
    EXPECT_LT(equations.information(0, 0), 3.0 * known) << seed;
    EXPECT_GT(equations.information(0, 0), 0.1 * known) << seed;
  }
}

}  // namespace
}  // namespace understory
