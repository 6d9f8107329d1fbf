#include "understory/simulation/sensors/weather.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/util/angles.h"

namespace understory {
namespace {

constexpr int kFirings = 40'000;

Eigen::Vector3f towards(double azimuth_deg, double elevation_deg) {
  const double azimuth = azimuth_deg * kDegree;
  const double elevation = elevation_deg * kDegree;
  return {static_cast<float>(std::cos(elevation) * std::sin(azimuth)),
          static_cast<float>(std::cos(elevation) * std::cos(azimuth)),
          static_cast<float>(std::sin(elevation))};
}

// Share of the firings of a second in which a beam gives a spurious range.
double share_of(const LidarWeather& weather, std::uint64_t beam, double time_s,
                const Eigen::Vector3f& direction) {
  int spurious = 0;
  for (int firing = 0; firing < kFirings; ++firing)
    spurious += weather.spurious({firing, beam, time_s, direction}) ? 1 : 0;
  return static_cast<double>(spurious) / kFirings;
}

TEST(LidarWeather, TheGlareIsAsStrongAsAskedTowardsTheSunAndFallsOffWithTheAngle) {
  LidarConfig config;
  config.sun_noise = 0.3;
  config.sun_azimuth_deg = 130.0;
  config.sun_elevation_deg = 12.0;
  const LidarWeather weather(config, 5);
  EXPECT_NEAR(share_of(weather, 3, 1.0, towards(130.0, 12.0)), 0.3, 0.01);
  // exp(-1/2) of it at 0.12 rad, level or upright.
  EXPECT_NEAR(share_of(weather, 3, 1.0, towards(130.0, 12.0 + 0.12 / kDegree)), 0.182, 0.01);
  EXPECT_EQ(share_of(weather, 3, 1.0, towards(310.0, 12.0)), 0.0);
  EXPECT_EQ(share_of(weather, 3, 1.0, towards(130.0, 60.0)), 0.0);
}

TEST(LidarWeather, AColdLaserIsWellOrGivesRangesUpToSixTenths) {
  LidarConfig config;
  config.cold_noise = 0.1;
  const LidarWeather weather(config, 5);
  double sum = 0.0;
  for (int spell = 0; spell < 400; ++spell) {
    const std::uint64_t beam = static_cast<std::uint64_t>(spell) % 16;
    int spurious = 0;
    for (int firing = 0; firing < 200; ++firing) {
      const auto reading =
          weather.spurious({spell * 200 + firing, beam, 0.25 * spell + 0.1, towards(0.0, 0.0)});
      if (!reading) continue;
      ++spurious;
      EXPECT_GE(reading->range_m, config.min_range_m - 1e-3);
      EXPECT_LE(reading->range_m, 0.6 * config.max_range_m + 1e-3);
      EXPECT_LE(reading->intensity, 25.0F);
    }
    EXPECT_TRUE(spurious == 0 || std::abs(spurious - 80) < 35) << spurious;
    sum += spurious;
  }
  EXPECT_NEAR(sum / (400.0 * 200.0), 0.1, 0.03);
}

TEST(LidarWeather, WithoutItNothingIsMet) {
  const LidarWeather weather(LidarConfig{}, 5);
  EXPECT_FALSE(weather.has_snow());
  EXPECT_FALSE(weather.has_spurious());
  BeamEcho echo;
  weather.add_flake_echo(3, 2, 1.0, echo);
  EXPECT_EQ(echo.surface, Surface::kNone);
}

}  // namespace
}  // namespace understory
