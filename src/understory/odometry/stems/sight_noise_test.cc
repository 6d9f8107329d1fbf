#include "understory/odometry/stems/sight_noise.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <random>
#include <vector>

namespace understory {
namespace {

// The gain after 100 views of 60 stems whose places walk at random and are seen with noise.
double gain_of(double noise_m, double walk_m, double least_noise_m = 0.0) {
  std::mt19937 random(7);
  std::normal_distribution<double> unit;
  const auto draw = [&](double sd) {
    return Eigen::Vector2d(sd * unit(random), sd * unit(random));
  };
  std::vector<Eigen::Vector2d> places(60, Eigen::Vector2d::Zero());
  std::vector<Eigen::Vector2d> sights = places;
  std::vector<Eigen::Vector2d> changes = places;
  SightNoise noise(least_noise_m);
  for (int view = 0; view < 100; ++view) {
    for (std::size_t i = 0; i < places.size(); ++i) {
      places[i] += draw(walk_m);
      const Eigen::Vector2d sight = places[i] + draw(noise_m);
      const Eigen::Vector2d change = sight - sights[i];
      if (view > 1)
        noise.add(change.squaredNorm(), changes[i].squaredNorm(), change.dot(changes[i]));
      changes[i] = change;
      sights[i] = sight;
    }
    noise.end_view();
  }
  return noise.gain();
}

// The steady gain of a Kalman filter of one place.
double kalman_gain(double noise_m, double walk_m) {
  double variance = 1.0;
  double gain = 1.0;
  for (int k = 0; k < 1000; ++k) {
    variance += walk_m * walk_m;
    gain = variance / (variance + noise_m * noise_m);
    variance *= 1.0 - gain;
  }
  return gain;
}

TEST(SightNoise, GivesTheGainOfTheFilterThatKnowsTheNoise) {
  for (const double walk : {0.02, 0.05, 0.1})
    EXPECT_NEAR(gain_of(0.1, walk), kalman_gain(0.1, walk), 0.06) << walk;
}

TEST(SightNoise, WithLittleNoiseTheNewestSightCounts) {
  EXPECT_EQ(gain_of(0.001, 0.05), 1.0);
  EXPECT_EQ(gain_of(0.1, 0.2), 1.0);
}

TEST(SightNoise, NoiseBelowTheLimitIsNotAveraged) {
  EXPECT_EQ(gain_of(0.05, 0.02, 0.15), 1.0);
  EXPECT_LT(gain_of(0.3, 0.02, 0.15), 0.3);
}

TEST(SightNoise, TheFirstSightsTellNothing) {
  SightNoise noise(0.0);
  for (int k = 0; k < 20; ++k)
    noise.add(0.01, 0.01, -0.01);
  EXPECT_EQ(noise.gain(), 1.0);
}

}  // namespace
}  // namespace understory
