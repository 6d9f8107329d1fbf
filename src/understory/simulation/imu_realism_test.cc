#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "understory/simulation/carrier/carrier.h"
#include "understory/simulation/sensors/inertial.h"

namespace understory {
namespace {

CarrierPath standing() {
  return CarrierPath(CarrierPath::Spline({Vector6d::Zero()}, 0.05));
}

// A silent IMU at rest, to which a test adds what it is about.
SiteConfig silent() {
  SiteConfig site;
  site.imu.gyro_noise = site.imu.accel_noise = 0.0;
  site.imu.gyro_bias_sd = site.imu.accel_bias_sd = 0.0;
  site.imu.gyro_bias_walk = site.imu.accel_bias_walk = 0.0;
  site.imu.scale_sd = site.imu.vibration_m_s2 = 0.0;
  site.imu.rate_hz = 20.0;
  return site;
}

std::vector<ImuSample> samples(const SiteConfig& site, std::size_t count,
                               const std::vector<double>& shocks_s = {}) {
  const CarrierPath path = standing();
  InertialSensor imu(site, path, 0, shocks_s);
  std::vector<ImuSample> all;
  for (std::size_t i = 0; i < count; ++i)
    all.push_back(imu.next());
  return all;
}

// Allan deviation of a series at an averaging time of `m` samples (non-overlapping).
double allan_deviation(const std::vector<double>& values, std::size_t m) {
  std::vector<double> means;
  for (std::size_t i = 0; i + m <= values.size(); i += m) {
    double sum = 0.0;
    for (std::size_t k = 0; k < m; ++k)
      sum += values[i + k];
    means.push_back(sum / static_cast<double>(m));
  }
  double sum = 0.0;
  for (std::size_t i = 1; i < means.size(); ++i)
    sum += std::pow(means[i] - means[i - 1], 2.0);
  return std::sqrt(0.5 * sum / static_cast<double>(means.size() - 1));
}

std::vector<double> gyro_x(const std::vector<ImuSample>& all) {
  std::vector<double> values;
  for (const ImuSample& sample : all)
    values.push_back(sample.angular_rate.x());
  return values;
}

TEST(ImuRealism, NoiseInstabilityAndWalkHaveTheirAllanFigures) {
  SiteConfig site = silent();
  site.imu.gyro_noise = 1e-3;
  const std::vector<double> white = gyro_x(samples(site, 200'000));
  EXPECT_NEAR(allan_deviation(white, 20), 1e-3, 3e-5);      // at 1 s: the density itself
  EXPECT_NEAR(allan_deviation(white, 320), 0.25e-3, 3e-5);  // falls with the root of time
  site = silent();
  site.imu.gyro_instability = 1e-4;
  double floor = 0.0;
  for (int seed = 1; seed <= 3; ++seed) {
    site.seed = seed;
    const std::vector<double> flicker = gyro_x(samples(site, 200'000));
    for (const std::size_t m : {100U, 400U, 1600U})
      floor += allan_deviation(flicker, m) / 9.0;
  }
  EXPECT_NEAR(floor, 0.664e-4, 0.08e-4);  // level from 5 to 80 s
  site = silent();
  site.imu.gyro_bias_walk = 1e-5;
  const std::vector<double> walk = gyro_x(samples(site, 200'000));
  EXPECT_NEAR(allan_deviation(walk, 400), 1e-5 * std::sqrt(20.0 / 3.0), 3e-6);
}

TEST(ImuRealism, BiasOfTheTruthIsThatOfTheSamples) {
  SiteConfig site = silent();
  site.imu.gyro_instability = 1e-3;
  site.imu.gyro_temperature = 1e-4;
  site.imu.accel_temperature = 1e-3;
  site.imu.gyro_bias_sd = 0.01;
  site.imu.warm_up_k = 20.0;
  site.imu.warm_up_s = 50.0;
  const CarrierPath path = standing();
  InertialSensor imu(site, path, 0);
  for (int i = 0; i < 4000; ++i) {
    const Eigen::Vector3d bias = imu.gyro_bias();
    EXPECT_LT((imu.next().angular_rate - bias).norm(), 1e-12);
  }
}

TEST(ImuRealism, WarmingDriftsToItsEndAndNoFurther) {
  SiteConfig site = silent();
  site.imu.accel_temperature = 1e-3;
  site.imu.warm_up_k = 20.0;
  site.imu.warm_up_s = 50.0;
  const std::vector<ImuSample> all = samples(site, 20'000);
  const Eigen::Vector3d first = all.front().specific_force;
  const Eigen::Vector3d middle = all[1000].specific_force;  // after one time constant
  const Eigen::Vector3d late = all[19'000].specific_force;
  EXPECT_GT((late - first).norm(), 5e-3);
  EXPECT_LT((late - first).norm(), 8e-2);
  EXPECT_NEAR((middle - first).norm() / (late - first).norm(), 1.0 - std::exp(-1.0), 0.01);
  EXPECT_LT((all[19'999].specific_force - late).norm(), 1e-6);
}

TEST(ImuRealism, ShocksRingWhenTheCarrierIsHitAndSaturate) {
  SiteConfig site = silent();
  site.imu.rate_hz = 500.0;
  site.imu.shock_m_s2 = 30.0;
  site.imu.shock_rad_s = 0.5;
  const auto peak_between = [](const std::vector<ImuSample>& all, double from, double to) {
    double peak = 0.0;
    for (const ImuSample& sample : all) {
      const double t = to_seconds(sample.stamp);
      if (t < from || t > to) continue;
      peak = std::max(peak, (sample.specific_force - all.front().specific_force).norm());
    }
    return peak;
  };
  std::vector<ImuSample> all = samples(site, 2500, {2.0, 4.0});
  EXPECT_EQ(peak_between(all, 0.0, 1.99), 0.0);
  EXPECT_GT(peak_between(all, 2.0, 2.2), 8.0);
  EXPECT_LT(peak_between(all, 2.0, 2.2), 46.0);
  EXPECT_LT(peak_between(all, 2.6, 3.99), 1e-9);
  EXPECT_GT(peak_between(all, 4.0, 4.2), 8.0);
  site.imu.accel_range_m_s2 = 12.0;
  site.imu.gyro_range_rad_s = 0.1;
  all = samples(site, 2500, {2.0, 4.0});
  bool clipped = false;
  for (const ImuSample& sample : all) {
    EXPECT_LE(sample.specific_force.cwiseAbs().maxCoeff(), 12.0);
    EXPECT_LE(sample.angular_rate.cwiseAbs().maxCoeff(), 0.1);
    clipped = clipped || sample.angular_rate.cwiseAbs().maxCoeff() == 0.1;
  }
  EXPECT_TRUE(clipped);
}

}  // namespace
}  // namespace understory
