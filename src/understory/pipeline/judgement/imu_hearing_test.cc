#include "understory/pipeline/judgement/imu_hearing.h"

#include <gtest/gtest.h>

#include <limits>

namespace understory {
namespace {

ImuSample sample(double time_s, double rate_rad_s) {
  ImuSample imu;
  imu.stamp = from_seconds(time_s);
  imu.angular_rate = {0.0, 0.0, rate_rad_s};
  imu.specific_force = {0.0, 0.0, 9.81};
  return imu;
}

TEST(ImuHearing, CountsTheTimeOfSamplesThatCannotBeUsed) {
  ImuHearing hearing;
  for (int k = 0; k < 100; ++k)
    hearing.add(sample(0.01 * k, 1.0), true, ImuNoiseConfig());
  EXPECT_EQ(hearing.unusable(), 0);
  for (int k = 100; k < 250; ++k)
    hearing.add(sample(0.01 * k, 100.0), true, ImuNoiseConfig());  // degrees per second
  EXPECT_NEAR(to_seconds(hearing.unusable()), 1.5, 1e-9);
  hearing.add(sample(2.51, std::numeric_limits<double>::quiet_NaN()), true, ImuNoiseConfig());
  EXPECT_NEAR(to_seconds(hearing.unusable()), 1.52, 1e-9);
  EXPECT_EQ(hearing.without_place(), 0);
}

TEST(ImuHearing, AHoleCountsATenthOfASecondAtMost) {
  ImuHearing hearing;
  hearing.add(sample(0.0, 1.0), false, ImuNoiseConfig());
  hearing.add(sample(5.0, 1.0), false, ImuNoiseConfig());
  EXPECT_NEAR(to_seconds(hearing.without_place()), 0.1, 1e-9);
  EXPECT_EQ(hearing.unusable(), 0);
}

TEST(ImuHearing, GoesOnFromACheckpoint) {
  ImuHearing hearing;
  hearing.add(sample(0.0, 100.0), true, ImuNoiseConfig());
  hearing.add(sample(0.05, 100.0), true, ImuNoiseConfig());
  BinaryWriter writer;
  hearing.save(writer);
  BinaryReader reader(writer.bytes(), "test");
  ImuHearing resumed;
  resumed.load(reader);
  resumed.add(sample(0.1, 100.0), true, ImuNoiseConfig());
  EXPECT_NEAR(to_seconds(resumed.unusable()), 0.1, 1e-9);
}

}  // namespace
}  // namespace understory
