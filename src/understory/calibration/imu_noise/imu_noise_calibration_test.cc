#include "understory/calibration/imu_noise/imu_noise_calibration.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "understory/simulation/carrier/carrier.h"
#include "understory/simulation/sensors/inertial.h"
#include "understory/simulation/site.h"

namespace understory {
namespace {

ImuNoiseResult calibrated(const SiteConfig& site, double duration_s) {
  const CarrierPath path(CarrierPath::Spline({Vector6d::Zero()}, 0.05));
  InertialSensor imu(site, path, 0);
  ImuNoiseCalibration calibration;
  while (to_seconds(imu.next_stamp()) < duration_s)
    calibration.add(imu.next());
  return calibration.result(0);
}

// An IMU of the FoMo data set, at a lower rate, which changes none of the densities.
SiteConfig slow_vectornav(int seed) {
  SiteConfig site = load_site("handheld", {"imu_preset=vectornav"});
  site.seed = seed;
  site.imu.rate_hz = 5.0;
  site.imu.vibration_m_s2 = 0.0;
  site.imu.gyro_bias_sd = 0.0;
  return site;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

// The full figures, at 200 Hz and over 10 h too, are those of bench_imu_noise.
TEST(ImuNoiseCalibration, AnHourFindsTheFiguresOfTheSimulatedImu) {
  std::vector<double> white;
  std::vector<double> instability;
  std::vector<double> walk;
  for (int seed = 0; seed < 10; ++seed) {
    const SiteConfig site = slow_vectornav(seed);
    const ImuNoiseResult result = calibrated(site, 3600.0);
    ASSERT_EQ(result.problem, ImuNoiseProblem::kNone) << result.reason;
    EXPECT_NEAR(result.noise.rate_hz, 5.0, 1e-6);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const AxisNoise& gyro = result.noise.gyroscope.axes[axis];
      const AxisNoise& accel = result.noise.accelerometer.axes[axis];
      white.push_back(std::abs(gyro.white.value / site.imu.gyro_noise - 1.0));
      white.push_back(std::abs(accel.white.value / site.imu.accel_noise - 1.0));
      instability.push_back(std::abs(gyro.instability.value / site.imu.gyro_instability - 1.0));
      instability.push_back(std::abs(accel.instability.value / site.imu.accel_instability - 1.0));
      walk.push_back(std::abs(gyro.walk.value / site.imu.gyro_bias_walk - 1.0));
      walk.push_back(std::abs(accel.walk.value / site.imu.accel_bias_walk - 1.0));
    }
  }
  EXPECT_LT(median(white), 0.01);
  EXPECT_LT(median(instability), 0.25);
  EXPECT_LT(median(walk), 0.30);
}

TEST(ImuNoiseCalibration, FiguresThatDoNotStandOutAreNamed) {
  const ImuNoiseResult result = calibrated(slow_vectornav(1), 120.0);
  ASSERT_EQ(result.problem, ImuNoiseProblem::kNone);
  ASSERT_FALSE(result.noise.shortcomings.empty());
  EXPECT_NE(result.noise.shortcomings[0].find("gyroscope: the bias instability"), std::string::npos)
      << result.noise.shortcomings[0];
}

TEST(ImuNoiseCalibration, TooShortRecordingsAndMotionAreProblems) {
  EXPECT_EQ(calibrated(slow_vectornav(1), 30.0).problem, ImuNoiseProblem::kTooShort);
  // The samples of a whole minute span an interval less.
  EXPECT_EQ(calibrated(slow_vectornav(1), 60.0).problem, ImuNoiseProblem::kNone);
  EXPECT_EQ(calibrated(slow_vectornav(1), 59.0).problem, ImuNoiseProblem::kTooShort);
  EXPECT_EQ(ImuNoiseCalibration().result(0).problem, ImuNoiseProblem::kNoSamples);
  ImuNoiseCalibration moving;
  ImuSample sample;
  for (int i = 0; i < 10'000; ++i) {
    sample.stamp = from_seconds(1000.0 + 0.01 * i);
    sample.angular_rate.z() = i > 6000 ? 0.5 * std::sin(0.1 * i) : 0.0;
    sample.specific_force.z() = 9.81;
    moving.add(sample);
  }
  const ImuNoiseResult result = moving.result(from_seconds(1000.0));
  EXPECT_EQ(result.problem, ImuNoiseProblem::kMoves);
  EXPECT_NE(result.reason.find("it stood from 0.0 s to 60.0 s"), std::string::npos)
      << result.reason;
}

TEST(ImuNoiseCalibration, LostSamplesAreToldAndCostLittle) {
  SiteConfig site = slow_vectornav(2);
  site.imu.rate_hz = 100.0;
  const CarrierPath path(CarrierPath::Spline({Vector6d::Zero()}, 0.05));
  InertialSensor imu(site, path, 0);
  ImuNoiseCalibration calibration;
  for (int i = 0; to_seconds(imu.next_stamp()) < 200.0; ++i) {
    if (i % 10 == 9) {
      imu.skip();
    } else {
      calibration.add(imu.next());
    }
  }
  const ImuNoiseResult result = calibration.result(0);
  ASSERT_EQ(result.problem, ImuNoiseProblem::kNone);
  EXPECT_NE(result.noise.shortcomings.back().find("10 % of the samples are lost"),
            std::string::npos)
      << result.noise.shortcomings.back();
  EXPECT_NEAR(result.noise.gyroscope.axes[0].white.value / site.imu.gyro_noise, 1.0, 0.1);
}

}  // namespace
}  // namespace understory
