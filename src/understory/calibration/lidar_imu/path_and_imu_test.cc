#include "understory/calibration/lidar_imu/path_and_imu.h"

#include <gtest/gtest.h>

#include "understory/calibration/lidar_imu/walk_test_support.h"

namespace understory {
namespace {

constexpr WalkErrors kNone{0.0, 0.0, 0.0, 0.0};

LidarImuState true_state(const SimulatedWalk& walk, double late_s) {
  LidarImuState state;
  state.lidar_from_imu = walk.lidar_from_imu;
  state.imu_late_s = late_s;
  state.gravity = {0.0, 0.0, -normal_gravity(61.2, 148.0)};
  return state;
}

// A silent IMU on the true path leaves residuals of its integration alone.
TEST(PathAndImu, ResidualsOfTheTruthAreSmall) {
  const SimulatedWalk walk = simulated_walk(
      3, 20.0, 0.02, kNone,
      {"imu.gyro_noise=0", "imu.accel_noise=0", "imu.gyro_bias_sd=0", "imu.accel_bias_sd=0",
       "imu.gyro_bias_walk=0", "imu.accel_bias_walk=0", "imu.scale_sd=0", "imu.vibration_m_s2=0"});
  const auto runs = runs_with_imu(walk.world_from_lidar, walk.imu, 0.02, 0.1);
  ASSERT_EQ(runs.size(), 1U);
  const LidarImuResiduals truth = lidar_imu_residuals(runs[0], walk.imu, true_state(walk, 0.02));
  EXPECT_LT(truth.turns.values.cwiseAbs().maxCoeff(), 2e-5);
  EXPECT_LT(truth.velocities.values.cwiseAbs().maxCoeff(), 2e-3);
  const LidarImuResiduals late = lidar_imu_residuals(runs[0], walk.imu, true_state(walk, 0.03));
  EXPECT_GT(late.turns.values.cwiseAbs().maxCoeff(), 1e-3);
  EXPECT_GT(late.velocities.values.cwiseAbs().maxCoeff(), 1e-2);
}

// Each derivative against a step of another size than that by which it was found.
TEST(PathAndImu, DerivativesAreThoseOfSteps) {
  const SimulatedWalk walk = simulated_walk(4, 8.0, 0.0);
  const auto runs = runs_with_imu(walk.world_from_lidar, walk.imu, 0.0, 0.1);
  ASSERT_EQ(runs.size(), 1U);
  const LidarImuState state = true_state(walk, 0.0);
  const LidarImuResiduals here = lidar_imu_residuals(runs[0], walk.imu, state);
  for (Eigen::Index k = 0; k < kLidarImuParameters; ++k) {
    LidarImuStep step = LidarImuStep::Zero();
    step[k] = k == kLatenessParameter ? 1e-3 : 1e-4;
    const LidarImuResiduals there = lidar_imu_residuals(runs[0], walk.imu, stepped(state, step));
    const Eigen::VectorXd turns = here.turns.values + here.turns.by_step * step;
    const Eigen::VectorXd velocities = here.velocities.values + here.velocities.by_step * step;
    EXPECT_LT((there.turns.values - turns).norm(), 1e-8 + 0.1 * (here.turns.by_step * step).norm())
        << k;
    EXPECT_LT((there.velocities.values - velocities).norm(),
              1e-8 + 0.1 * (here.velocities.by_step * step).norm())
        << k;
  }
}

TEST(PathAndImu, RunsEndAtGapsOfPathAndImu) {
  SimulatedWalk walk = simulated_walk(4, 20.0, 0.0);
  EXPECT_EQ(runs_with_imu(walk.world_from_lidar, walk.imu, 0.0, 0.3).size(), 1U);
  auto gap = walk.world_from_lidar;
  gap.erase(gap.begin() + 100, gap.begin() + 110);
  EXPECT_EQ(runs_with_imu(gap, walk.imu, 0.0, 0.3).size(), 2U);
  EXPECT_TRUE(runs_with_imu(walk.world_from_lidar, walk.imu, 100.0, 0.3).empty());
}

}  // namespace
}  // namespace understory
