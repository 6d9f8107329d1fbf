#include "understory/calibration/imu_noise/standing_watch.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/util/random.h"

namespace understory {
namespace {

// At 100 Hz from `from_s` on; `turning` is the amplitude of a turning at 1 Hz, rad/s.
void add_samples(StandingWatch& watch, Random& random, double from_s, double to_s, double turning,
                 double tilt = 0.0) {
  for (double t = from_s; t < to_s - 0.005; t += 0.01) {
    ImuSample sample;
    sample.stamp = from_seconds(t);
    sample.angular_rate =
        Eigen::Vector3d(0.001 * random.normal(), 0.0, turning * std::sin(6.28 * t));
    sample.specific_force =
        Eigen::Vector3d(9.81 * std::sin(tilt), 0.01 * random.normal(), 9.81 * std::cos(tilt));
    watch.add(sample);
  }
}

TEST(StandingWatch, StandsFromTheFirstToTheLastSample) {
  StandingWatch watch;
  Random random(1, 0);
  add_samples(watch, random, 5.0, 17.3, 0.0);
  const auto stretches = watch.stretches();
  ASSERT_EQ(stretches.size(), 1U);
  EXPECT_EQ(stretches[0].from, from_seconds(5.0));
  EXPECT_NEAR(to_seconds(stretches[0].to), 17.29, 1e-6);
}

TEST(StandingWatch, MotionEndsAStretch) {
  StandingWatch watch;
  Random random(1, 0);
  add_samples(watch, random, 0.0, 10.0, 0.0);
  add_samples(watch, random, 10.0, 15.0, 0.3);
  add_samples(watch, random, 15.0, 40.0, 0.0);
  const auto stretches = watch.stretches();
  ASSERT_EQ(stretches.size(), 2U);
  EXPECT_NEAR(to_seconds(stretches[0].to), 10.0, 1.01);
  EXPECT_NEAR(to_seconds(stretches[1].from), 15.0, 1.01);
}

TEST(StandingWatch, ANewTiltAndAGapEndAStretch) {
  StandingWatch watch;
  Random random(1, 0);
  add_samples(watch, random, 0.0, 10.0, 0.0);
  add_samples(watch, random, 10.0, 20.0, 0.0, 0.02);
  add_samples(watch, random, 21.0, 30.0, 0.0, 0.02);
  EXPECT_EQ(watch.stretches().size(), 3U);
}

TEST(StandingWatch, WalkingIsNeverStanding) {
  StandingWatch watch;
  Random random(1, 0);
  add_samples(watch, random, 0.0, 10.0, 0.3);
  EXPECT_TRUE(watch.stretches().empty());
}

}  // namespace
}  // namespace understory
