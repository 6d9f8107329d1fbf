#include "understory/calibration/lidar_imu/lidar_imu_calibration.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "understory/calibration/lidar_imu/walk_test_support.h"
#include "understory/util/angles.h"

namespace understory {
namespace {

Eigen::Matrix<double, 7, 1> error_of(const LidarImuResult& result, const Pose& truth,
                                     double late_s) {
  Eigen::Matrix<double, 7, 1> error;
  error << so3_log(truth.rotation().conjugate() * result.lidar_from_imu.rotation()),
      result.lidar_from_imu.translation() - truth.translation(), result.imu_late_s - late_s;
  return error;
}

TEST(LidarImuCalibration, FindsOffsetAndPlaceOfAWalkWithHonestCovariance) {
  double chi = 0.0;
  Eigen::Matrix<double, 7, 1> squares = Eigen::Matrix<double, 7, 1>::Zero();
  constexpr int kWalks = 6;
  for (int seed = 0; seed < kWalks; ++seed) {
    const double late = 0.013 - 0.004 * seed;
    const SimulatedWalk walk = simulated_walk(seed, 60.0, late);
    const Pose given = walk.lidar_from_imu * Pose(so3_exp({0.03, -0.04, 0.02}), {0.1, -0.1, 0.1});
    const LidarImuResult result = calibrate_lidar_imu(walk.world_from_lidar, walk.imu, given, 0.0);
    ASSERT_EQ(result.problem, "");
    EXPECT_TRUE(result.kept.empty());
    const auto error = error_of(result, walk.lidar_from_imu, late);
    squares += error.cwiseAbs2() / kWalks;
    chi += error.dot(result.covariance.inverse() * error) / 7.0 / kWalks;
  }
  EXPECT_LT(std::sqrt(squares.head<3>().sum()), 0.1 * kDegree);
  EXPECT_LT(std::sqrt(squares.segment<3>(3).sum()), 0.02);
  EXPECT_LT(std::sqrt(squares[6]), 1e-3);
  EXPECT_GT(chi, 0.5);
  EXPECT_LT(chi, 1.6);
}

TEST(LidarImuCalibration, WhatStandingDoesNotTellIsKeptAsGiven) {
  const SimulatedWalk walk = simulated_walk(3, 25.0, 0.0, {}, {"carrier.still_s=60"});
  const Pose given = walk.lidar_from_imu * Pose(so3_exp({0.0, 0.0, 0.1}), {0.3, 0.0, 0.0});
  const LidarImuResult result = calibrate_lidar_imu(walk.world_from_lidar, walk.imu, given, 0.01);
  ASSERT_EQ(result.problem, "");
  ASSERT_EQ(result.kept.size(), 3U);
  EXPECT_NEAR(result.imu_late_s, 0.01, 1e-6);
  EXPECT_LT((result.lidar_from_imu.translation() - given.translation()).norm(), 1e-5);
}

TEST(LidarImuCalibration, TooShortAPathIsAProblem) {
  const SimulatedWalk walk = simulated_walk(3, 8.0, 0.0);
  const LidarImuResult result =
      calibrate_lidar_imu(walk.world_from_lidar, walk.imu, walk.lidar_from_imu, 0.0);
  EXPECT_NE(result.problem.find("at least 10 s"), std::string::npos) << result.problem;
}

// 237 s of a handheld scanner (Newer College), whose path was made with this IMU.
TEST(LidarImuCalibration, RealPathThatWasMadeWithTheImuHasNoOffset) {
  const char* data = std::getenv("UNDERSTORY_DATA");
  const std::filesystem::path folder =
      (data != nullptr ? std::filesystem::path(data)
                       : std::filesystem::path(UNDERSTORY_SOURCE_DIR) / "../shared/data") /
      "gtsam_points/continuous";
  std::ifstream imu(folder / "imu.txt");
  std::ifstream poses(folder / "traj.txt");
  if (!imu || !poses) GTEST_SKIP() << "no example data in " << folder;
  std::vector<StampedPose> path;
  std::string line;
  while (std::getline(poses, line)) {
    std::istringstream text(line);
    std::string stamp;
    Eigen::Vector3d p;
    Eigen::Quaterniond q;
    text >> stamp >> p.x() >> p.y() >> p.z() >> q.x() >> q.y() >> q.z() >> q.w();
    TimeNs time = 0;
    if (parse_seconds(stamp, time)) path.push_back({time, Pose(q.normalized(), p)});
  }
  const Eigen::Quaterniond turned = so3_exp(3.0 * kDegree * Eigen::Vector3d(0.6, 0.64, -0.48));
  ImuBuffer samples(ImuNoiseConfig(), nullptr);
  ImuBuffer spoilt(ImuNoiseConfig(), nullptr);
  while (std::getline(imu, line)) {
    std::istringstream text(line);
    std::string stamp;
    ImuSample s;
    text >> stamp >> s.specific_force.x() >> s.specific_force.y() >> s.specific_force.z() >>
        s.angular_rate.x() >> s.angular_rate.y() >> s.angular_rate.z();
    if (!parse_seconds(stamp, s.stamp)) continue;
    samples.add(s);
    s.stamp += from_seconds(0.013);
    s.angular_rate = turned.conjugate() * s.angular_rate;
    s.specific_force = turned.conjugate() * s.specific_force;
    spoilt.add(s);
  }
  const LidarImuResult as_is = calibrate_lidar_imu(path, samples, Pose(), 0.0);
  ASSERT_EQ(as_is.problem, "");
  const auto error = error_of(as_is, Pose(), 0.0);
  EXPECT_LT(error.head<3>().norm(), 0.05 * kDegree) << error.transpose();
  EXPECT_LT(std::abs(error[6]), 1e-3) << error.transpose();
  const LidarImuResult found = calibrate_lidar_imu(path, spoilt, Pose(), 0.0);
  ASSERT_EQ(found.problem, "");
  const auto left = error_of(found, Pose(turned, Eigen::Vector3d::Zero()), 0.013);
  EXPECT_LT(left.head<3>().norm(), 0.05 * kDegree) << left.transpose();
  EXPECT_LT(std::abs(left[6]), 1e-3) << left.transpose();
}

}  // namespace
}  // namespace understory
