#include "understory/calibration/imu_noise/noise_fit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "understory/util/random.h"

namespace understory {
namespace {

std::vector<AllanPoint> exact_curve(double white, double instability, double walk) {
  std::vector<AllanPoint> curve;
  for (double time = 0.005; time < 1300.0; time *= 2.0) {
    const Eigen::Vector3d squares(white * white, instability * instability, walk * walk);
    const double deviation = std::sqrt(allan_variances_of_unit_noise(time).dot(squares));
    curve.push_back({time, deviation, 1000});
  }
  return curve;
}

TEST(NoiseFit, FindsTheFiguresOfAnExactCurve) {
  const AxisNoise noise = fit_noise(exact_curve(5e-5, 2e-5, 1e-6), 3900.0);
  EXPECT_NEAR(noise.white.value, 5e-5, 1e-9);
  EXPECT_NEAR(noise.instability.value, 2e-5, 4e-8);
  EXPECT_NEAR(noise.walk.value, 1e-6, 4e-9);
  EXPECT_TRUE(noise.white.found);
}

TEST(NoiseFit, WhiteNoiseAloneHasNoOtherFigure) {
  const AxisNoise noise = fit_noise(exact_curve(5e-5, 0.0, 0.0), 3900.0);
  EXPECT_NEAR(noise.white.value, 5e-5, 1e-9);
  EXPECT_FALSE(noise.instability.found);
  EXPECT_FALSE(noise.walk.found);
  EXPECT_LT(noise.instability.limit, 1e-5);
  EXPECT_LT(noise.walk.limit, 1e-6);
}

// The variances of unit noise against the integral over the noise's spectrum:
// 4 times that of S(f) sin(pi f t)^4 / (pi f t)^2.
TEST(NoiseFit, UnitVariancesAreThoseOfTheSpectra) {
  for (const double time : {0.5, 8.0}) {
    Eigen::RowVector3d sums = Eigen::RowVector3d::Zero();
    const double step = 2e-4 / time;
    for (double f = 0.5 * step; f < 400.0 / time; f += step) {
      const double x = std::numbers::pi * f * time;
      const double share = 4.0 * std::pow(std::sin(x), 4.0) / (x * x) * step;
      const double omega = 2.0 * std::numbers::pi * f;
      sums += share * Eigen::RowVector3d(1.0, 1.0 / omega, 1.0 / (omega * omega));
    }
    const Eigen::RowVector3d units = allan_variances_of_unit_noise(time);
    EXPECT_TRUE((sums.array() / units.array() - 1.0).abs().maxCoeff() < 2e-3) << sums << units;
  }
}

// Standard deviations of white noise and random walk against how the figures scatter.
TEST(NoiseFit, StandardDeviationsAreThoseOfRepeatedFits) {
  double white_square = 0.0;
  double walk_square = 0.0;
  constexpr int kFits = 100;
  for (int seed = 1; seed <= kFits; ++seed) {
    Random random(static_cast<std::uint64_t>(seed), 0);
    AllanDeviation allan;
    double bias = 0.0;
    for (int i = 0; i < 2000; ++i) {
      bias += 0.02 * random.normal();
      allan.add(bias + random.normal());
    }
    const AxisNoise noise = fit_noise(allan.curve(1.0), 2000.0);
    white_square += std::pow((noise.white.value - 1.0) / noise.white.sd, 2.0) / kFits;
    walk_square += std::pow((noise.walk.value - 0.02) / std::max(noise.walk.sd, 1e-4), 2.0) / kFits;
  }
  EXPECT_NEAR(white_square, 1.0, 0.4);
  EXPECT_NEAR(walk_square, 1.0, 0.5);
}

}  // namespace
}  // namespace understory
