#include "understory/pipeline/judgement/imu_usage.h"

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

TEST(ImuUsage, CountsTheTimeOfSamplesThatCannotBeUsed) {
  ImuUsage usage;
  for (int k = 0; k < 100; ++k)
    usage.add(sample(0.01 * k, 1.0), true, ImuNoiseConfig());
  EXPECT_EQ(usage.unusable(), 0);
  for (int k = 100; k < 250; ++k)
    usage.add(sample(0.01 * k, 100.0), true, ImuNoiseConfig());  // degrees per second
  EXPECT_NEAR(to_seconds(usage.unusable()), 1.5, 1e-9);
  usage.add(sample(2.51, std::numeric_limits<double>::quiet_NaN()), true, ImuNoiseConfig());
  EXPECT_NEAR(to_seconds(usage.unusable()), 1.52, 1e-9);
  EXPECT_EQ(usage.without_place(), 0);
}

TEST(ImuUsage, AHoleCountsATenthOfASecondAtMost) {
  ImuUsage usage;
  usage.add(sample(0.0, 1.0), false, ImuNoiseConfig());
  usage.add(sample(5.0, 1.0), false, ImuNoiseConfig());
  EXPECT_NEAR(to_seconds(usage.without_place()), 0.1, 1e-9);
  EXPECT_EQ(usage.unusable(), 0);
}

TEST(ImuUsage, GoesOnFromACheckpoint) {
  ImuUsage usage;
  usage.add(sample(0.0, 100.0), true, ImuNoiseConfig());
  usage.add(sample(0.05, 100.0), true, ImuNoiseConfig());
  BinaryWriter writer;
  usage.save(writer);
  BinaryReader reader(writer.bytes(), "test");
  ImuUsage resumed;
  resumed.load(reader);
  resumed.add(sample(0.1, 100.0), true, ImuNoiseConfig());
  EXPECT_NEAR(to_seconds(resumed.unusable()), 0.1, 1e-9);
}

}  // namespace
}  // namespace understory
