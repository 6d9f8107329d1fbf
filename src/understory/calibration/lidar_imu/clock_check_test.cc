#include "understory/calibration/lidar_imu/clock_check.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/calibration/lidar_imu/walk_test_support.h"
#include "understory/util/angles.h"

namespace understory {
namespace {

// What the check says of a walk. `turned`: of the given axes of the IMU against the true ones.
std::optional<ClockCheckResult> checked(const SimulatedWalk& walk,
                                        const Eigen::Quaterniond& turned = {1, 0, 0, 0},
                                        std::size_t save_at = 0, bool about_up = false) {
  using Turns = LidarImuClockCheck::Turns;
  const LidarImuClockCheck fresh(ImuNoiseConfig(), about_up ? Turns::kAboutUp : Turns::kAll);
  LidarImuClockCheck check = fresh;
  Random tilting(17, 0);
  const Eigen::Quaterniond lidar_from_imu = walk.lidar_from_imu.rotation() * turned;
  const auto on_scan = [&](std::size_t i, const StampedPose& pose) {
    // Stems hardly tell the tilt.
    const double degrees = about_up ? 1.0 : 0.0;
    const Eigen::Vector3d tilt(tilting.normal(), tilting.normal(), 0.0);
    check.add_scan(pose.stamp, pose.stamp,
                   so3_exp(degrees * kDegree * tilt) * pose.world_from_body.rotation(),
                   lidar_from_imu);
    if (i + 1 != save_at) return;
    BinaryWriter writer;
    check.save(writer);
    BinaryReader reader(writer.bytes(), "saved");
    check = fresh;
    check.load(reader);
  };
  replay(
      walk, [&](const ImuSample& sample) { check.add_sample(sample); }, on_scan);
  return check.result();
}

TEST(ClockCheck, TellsALateClockAndIsSilentAboutAGoodOne) {
  for (int seed = 0; seed < 4; ++seed) {
    const auto good = checked(simulated_walk(seed, 30.0, 0.0));
    ASSERT_TRUE(good);
    EXPECT_FALSE(good->clock_is_off()) << seed << ": " << good->late_s;
    EXPECT_FALSE(good->axes_are_off()) << seed << ": " << good->turned_rad / kDegree;
    EXPECT_LT(std::abs(good->late_s), 0.003);
    const double late_s = seed % 2 == 0 ? 0.02 : -0.02;
    const auto late = checked(simulated_walk(seed, 30.0, late_s));
    ASSERT_TRUE(late);
    EXPECT_TRUE(late->clock_is_off()) << seed << ": " << late->late_s << " " << late->late_sd_s;
    EXPECT_NEAR(late->late_s, late_s, 0.004);
    EXPECT_FALSE(late->axes_are_off()) << seed << ": " << late->turned_rad / kDegree;
  }
}

TEST(ClockCheck, TellsALateClockByTurnsAboutUpAlone) {
  for (int seed = 0; seed < 4; ++seed) {
    const auto good = checked(simulated_walk(seed, 40.0, 0.0), {1, 0, 0, 0}, 0, true);
    ASSERT_TRUE(good);
    EXPECT_FALSE(good->clock_is_off()) << seed << ": " << good->late_s << " " << good->late_sd_s;
    const double late_s = seed % 2 == 0 ? 0.02 : -0.02;
    const auto late = checked(simulated_walk(seed, 40.0, late_s), {1, 0, 0, 0}, 0, true);
    ASSERT_TRUE(late);
    EXPECT_TRUE(late->clock_is_off()) << seed << ": " << late->late_s << " " << late->late_sd_s;
    EXPECT_NEAR(late->late_s, late_s, 0.006);
    EXPECT_FALSE(late->axes_are_off());
  }
}

TEST(ClockCheck, TellsTurnedAxes) {
  const Eigen::Quaterniond turned = so3_exp(2.0 * kDegree * Eigen::Vector3d(0.6, -0.64, 0.48));
  const auto found = checked(simulated_walk(5, 30.0, 0.0), turned);
  ASSERT_TRUE(found);
  EXPECT_TRUE(found->axes_are_off());
  EXPECT_NEAR(found->turned_rad, 2.0 * kDegree, 0.4 * kDegree);
  EXPECT_FALSE(found->clock_is_off());
}

TEST(ClockCheck, StandingAndShortWalksTellNothing) {
  EXPECT_FALSE(checked(simulated_walk(3, 30.0, 0.02, {}, {"carrier.still_s=60"})));
  EXPECT_FALSE(checked(simulated_walk(3, 8.0, 0.02)));
}

TEST(ClockCheck, GoesOnFromWhatWasSaved) {
  const SimulatedWalk walk = simulated_walk(1, 40.0, 0.02);
  const auto whole = checked(walk);
  const auto resumed = checked(walk, {1, 0, 0, 0}, 301);
  ASSERT_TRUE(whole && resumed);
  EXPECT_EQ(whole->late_s, resumed->late_s);
  EXPECT_EQ(whole->duration_s, resumed->duration_s);
}

TEST(ClockCheck, ALoopThatTurnsTheWorldIsNoTurnOfTheLidar) {
  SimulatedWalk walk = simulated_walk(2, 30.0, 0.0);
  const Eigen::Quaterniond turn = so3_exp({0.0, 0.0, 0.5});
  LidarImuClockCheck check;
  const auto samples =
      walk.imu.samples(walk.world_from_lidar.front().stamp, walk.world_from_lidar.back().stamp);
  std::size_t next = 0;
  for (std::size_t i = 0; i < walk.world_from_lidar.size(); ++i) {
    StampedPose pose = walk.world_from_lidar[i];
    for (; next < samples.size() && samples[next].stamp <= pose.stamp; ++next) {
      ImuSample sample;
      sample.stamp = samples[next].stamp;
      sample.angular_rate = samples[next].angular_rate();
      sample.specific_force = samples[next].specific_force();
      check.add_sample(sample);
    }
    if (i == 150) check.turn_world(turn);
    const Eigen::Quaterniond attitude =
        i < 150 ? pose.world_from_body.rotation() : turn * pose.world_from_body.rotation();
    check.add_scan(pose.stamp, pose.stamp, attitude, walk.lidar_from_imu.rotation());
  }
  const auto turned = check.result();
  const auto whole = checked(walk);
  ASSERT_TRUE(turned && whole);
  EXPECT_NEAR(turned->late_s, whole->late_s, 1e-6);
}

}  // namespace
}  // namespace understory
