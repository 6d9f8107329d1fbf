#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <sstream>
#include <vector>

#include "understory/odometry/imu/imu_buffer.h"
#include "understory/odometry/imu/window_smoother.h"

namespace understory {
namespace {

struct Log237 {
  std::vector<ImuSample> imu;
  std::vector<StampedPose> poses;
};

// 237 s of a handheld scanner (Newer College): IMU at 100 Hz and a trajectory at 10 Hz. Its makers
// most likely got that from this IMU and the lidar, so it is no independent truth.
bool read_log(Log237& log) {
  const char* data = std::getenv("UNDERSTORY_DATA");
  const std::filesystem::path folder =
      (data != nullptr ? std::filesystem::path(data)
                       : std::filesystem::path(UNDERSTORY_SOURCE_DIR) / "../shared/data") /
      "gtsam_points/continuous";
  std::ifstream imu(folder / "imu.txt");
  std::ifstream poses(folder / "traj.txt");
  if (!imu || !poses) return false;
  std::string line;
  while (std::getline(imu, line)) {
    std::istringstream text(line);
    std::string stamp;
    ImuSample s;
    text >> stamp >> s.specific_force.x() >> s.specific_force.y() >> s.specific_force.z() >>
        s.angular_rate.x() >> s.angular_rate.y() >> s.angular_rate.z();
    if (parse_seconds(stamp, s.stamp)) log.imu.push_back(s);
  }
  while (std::getline(poses, line)) {
    std::istringstream text(line);
    std::string stamp;
    Eigen::Vector3d p;
    Eigen::Quaterniond q;
    text >> stamp >> p.x() >> p.y() >> p.z() >> q.x() >> q.y() >> q.z() >> q.w();
    TimeNs time = 0;
    if (parse_seconds(stamp, time)) log.poses.push_back({time, Pose(q, p)});
  }
  return true;
}

struct Errors {
  double rotation_deg = 0.0;
  double position_m = 0.0;
  int count = 0;
};

// Smooths up to each pose (biases and velocity from the past alone). Then it predicts a second
// ahead with the IMU alone and compares with the trajectory.
Errors predict_a_second(const Log237& log) {
  ImuNoiseConfig noise;
  noise.gyro_noise_rad_s_sqrt_hz = 5e-4;
  noise.accel_noise_m_s2_sqrt_hz = 1e-2;
  noise.gyro_bias_walk_rad_s2_sqrt_hz = 2e-5;
  noise.accel_bias_walk_m_s3_sqrt_hz = 5e-4;
  ImuBuffer buffer(noise, nullptr);
  for (const ImuSample& sample : log.imu)
    buffer.add(sample);
  WindowSmoother smoother({20, 2, noise});
  Errors errors;
  double previous = 0.0;
  for (std::size_t i = 0; i < log.poses.size(); ++i) {
    const StampedPose& pose = log.poses[i];
    if (!smoother.started()) {
      if (buffer.slice(pose.stamp, pose.stamp + 100'000'000).empty()) continue;
      ImuState state;
      state.stamp = pose.stamp;
      state.world_from_imu = pose.world_from_body;
      InitialUncertainty sigma;
      sigma.rotation_rad = 1e-3;
      sigma.position_m = 5e-3;
      smoother.start(state, Eigen::Vector3d::UnitZ(), sigma);
      previous = to_seconds(pose.stamp - log.poses.front().stamp);
      continue;
    }
    const ImuState& latest = smoother.latest();
    MotionInterval interval;
    interval.samples = buffer.slice(latest.stamp, pose.stamp);
    if (interval.samples.empty()) break;
    interval.motion = preintegrate(interval.samples, latest.gyro_bias, latest.accel_bias, noise);
    PoseFactor factor{pose.world_from_body, Matrix6d::Zero()};
    factor.covariance.diagonal() << Eigen::Vector3d::Constant(2.5e-7),
        Eigen::Vector3d::Constant(2.5e-5);
    smoother.add(pose.stamp, interval, factor);
    const double elapsed = to_seconds(pose.stamp - log.poses.front().stamp);
    if (elapsed - previous < 1.0 || elapsed < 20.0 || i + 10 >= log.poses.size()) continue;
    previous = elapsed;
    const StampedPose& later = log.poses[i + 10];
    const auto samples = buffer.slice(pose.stamp, later.stamp);
    if (samples.empty()) break;
    const ImuState& now = smoother.latest();
    const ImuState predicted =
        predict_state(now, preintegrate(samples, now.gyro_bias, now.accel_bias, noise), later.stamp,
                      smoother.gravity());
    // Relative motion against that of the trajectory.
    const Pose ours = now.world_from_imu.inverse() * predicted.world_from_imu;
    const Pose theirs = pose.world_from_body.inverse() * later.world_from_body;
    const Pose difference = theirs.inverse() * ours;
    const double degrees = difference.angle() * 180.0 / std::numbers::pi;
    errors.rotation_deg += degrees * degrees;
    errors.position_m += (ours.translation() - theirs.translation()).squaredNorm();
    ++errors.count;
  }
  errors.rotation_deg = std::sqrt(errors.rotation_deg / errors.count);
  errors.position_m = std::sqrt(errors.position_m / errors.count);
  return errors;
}

TEST(RealImu, PredictsASecondOfARealHandheldScanner) {
  Log237 log;
  if (!read_log(log)) GTEST_SKIP() << "gtsam_points/continuous is not there";
  const Errors errors = predict_a_second(log);
  RecordProperty("rotation_rmse_deg", std::to_string(errors.rotation_deg));
  RecordProperty("position_rmse_m", std::to_string(errors.position_m));
  std::printf(
      "%d seconds: rotation %.4f deg, position %.4f m (RMSE; the trajectory is probably "
      "not independent of this IMU)\n",
      errors.count, errors.rotation_deg, errors.position_m);
  EXPECT_GT(errors.count, 150);
  EXPECT_LT(errors.rotation_deg, 0.04);
  EXPECT_LT(errors.position_m, 0.02);
}

}  // namespace
}  // namespace understory
