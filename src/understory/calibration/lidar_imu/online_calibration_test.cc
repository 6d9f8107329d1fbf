#include "understory/calibration/lidar_imu/online_calibration.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/calibration/lidar_imu/walk_test_support.h"
#include "understory/util/angles.h"

namespace understory {
namespace {

// What is refined over a walk that is mapped with `given` in place of the true place of the IMU.
OnlineImuCalibration over(const SimulatedWalk& walk, const Pose& given, std::size_t save_at = 0,
                          std::size_t break_at = 0) {
  OnlineImuCalibration online;
  const auto on_scan = [&](std::size_t i, const StampedPose& pose) {
    online.add_scan(pose, given);
    if (i + 1 == break_at) online.break_off();
    if (i + 1 != save_at) return;
    BinaryWriter writer;
    online.save(writer);
    BinaryReader reader(writer.bytes(), "saved");
    online = OnlineImuCalibration();
    online.load(reader);
  };
  replay(
      walk, [&](const ImuSample& sample) { online.add_sample(sample); }, on_scan);
  return online;
}

Pose put_wrong(const Pose& truth, double turn_deg, double shift_m) {
  return Pose(truth.rotation() * so3_exp(turn_deg * kDegree * Eigen::Vector3d(0.6, -0.64, 0.48)),
              truth.translation() + shift_m * Eigen::Vector3d(0.8, 0.0, -0.6));
}

// The poses that wait for samples must not grow with the run.
TEST(OnlineImuCalibration, AnImuThatStopsLeavesNoMoreThanAWindow) {
  OnlineImuCalibration online;
  const auto size_after = [&](int first, int last) {
    for (int i = first; i < last; ++i) {
      StampedPose pose;
      pose.stamp = from_seconds(0.1 * i);
      online.add_scan(pose, Pose());
    }
    BinaryWriter writer;
    online.save(writer);
    return writer.bytes().size();
  };
  const std::size_t a_window = size_after(0, 200);
  EXPECT_LE(size_after(200, 5000), 2 * a_window);
  EXPECT_FALSE(online.finished());
}

TEST(OnlineImuCalibration, FindsClockAndPlaceThatAreWrong) {
  const SimulatedWalk walk = simulated_walk(2, 62.0, 0.015);
  const auto found = over(walk, put_wrong(walk.lidar_from_imu, 1.5, 0.1)).so_far();
  ASSERT_TRUE(found);
  EXPECT_TRUE(found->differs);
  EXPECT_EQ(found->windows, 3U);
  EXPECT_NEAR(found->late_s, 0.015, 0.001);
  const Pose error = walk.lidar_from_imu.inverse() * found->body_from_imu;
  EXPECT_LT(so3_log(error.rotation()).norm(), 0.15 * kDegree);
  EXPECT_LT(error.translation().norm(), 0.03);
  EXPECT_LT(std::sqrt(found->covariance(6, 6)), 0.001);
}

TEST(OnlineImuCalibration, LeavesGoodValuesAndToldErrorsFit) {
  double squared = 0.0;
  constexpr int kSeeds = 6;
  for (int seed = 0; seed < kSeeds; ++seed) {
    const SimulatedWalk walk = simulated_walk(seed, 42.0, 0.0);
    const auto found = over(walk, walk.lidar_from_imu).finished();
    ASSERT_TRUE(found);
    EXPECT_FALSE(found->differs) << seed << ": " << found->late_s;
    squared += found->late_s * found->late_s / found->covariance(6, 6) / kSeeds;
  }
  EXPECT_LT(squared, 3.0);
}

TEST(OnlineImuCalibration, WindowsTellMoreThanOne) {
  const SimulatedWalk walk = simulated_walk(1, 62.0, 0.0);
  const SimulatedWalk beginning = simulated_walk(1, 21.0, 0.0);
  const auto one = over(beginning, walk.lidar_from_imu).so_far();
  const auto three = over(walk, walk.lidar_from_imu).so_far();
  ASSERT_TRUE(one && three);
  EXPECT_EQ(one->windows, 1U);
  for (Eigen::Index k = 0; k < 7; ++k)
    EXPECT_LT(three->covariance(k, k), 0.7 * one->covariance(k, k)) << k;
}

TEST(OnlineImuCalibration, StandingTellsNothing) {
  const SimulatedWalk walk = simulated_walk(3, 30.0, 0.02, {}, {"carrier.still_s=60"});
  EXPECT_FALSE(over(walk, walk.lidar_from_imu).finished());
}

TEST(OnlineImuCalibration, ShortPiecesTellNothing) {
  const SimulatedWalk walk = simulated_walk(3, 14.0, 0.02);
  EXPECT_TRUE(over(walk, walk.lidar_from_imu).finished());
  EXPECT_FALSE(over(walk, walk.lidar_from_imu, 0, 70).finished());
}

TEST(OnlineImuCalibration, GoesOnFromWhatWasSaved) {
  const SimulatedWalk walk = simulated_walk(1, 45.0, 0.02);
  const auto whole = over(walk, walk.lidar_from_imu).finished();
  const auto resumed = over(walk, walk.lidar_from_imu, 301).finished();
  ASSERT_TRUE(whole && resumed);
  EXPECT_EQ(whole->late_s, resumed->late_s);
  EXPECT_TRUE(whole->covariance == resumed->covariance);
}

}  // namespace
}  // namespace understory
