// The estimate of the motion begins anew where the IMU turns out to be wrong.
#include <gtest/gtest.h>

#include <algorithm>

#include "understory/odometry/motion/motion_model.h"
#include "understory/util/angles.h"

namespace understory {
namespace {

constexpr double kTurnsFrom = 5.0;  // s
constexpr double kRate = 60.0;      // degrees a second, about z

double turned_deg(double t) {
  return t < kTurnsFrom ? 0.0 : (t - kTurnsFrom) * kRate;
}

// A gyroscope that tells the opposite.
ImuSample wrong_sample(double t) {
  ImuSample sample;
  sample.stamp = from_seconds(t);
  sample.angular_rate.z() = t < kTurnsFrom ? 0.0 : -kRate * kDegree;
  sample.specific_force.z() = 9.80665;
  return sample;
}

LidarFactor right_match(const Pose& world_from_body) {
  LidarFactor factor;
  factor.world_from_body = world_from_body;
  factor.information = Matrix6d::Zero();
  factor.information.diagonal().head<3>().setConstant(1.0 / (5e-4 * 5e-4));
  factor.information.diagonal().tail<3>().setConstant(1.0 / (5e-3 * 5e-3));
  return factor;
}

// A restart corrects 70 degrees at once. That is no motion that goes on.
TEST(ImuRestart, WhatItCorrectsIsNoTurn) {
  MotionConfig config;
  config.lidar.source = LidarNoise::kInformation;
  config.lidar.information_divisor = 1.0;
  Rig rig;
  rig.body_from_imu = Pose();
  Log log;
  const auto model = make_imu_smoother(config, rig, &log);
  double imu_t = 0.0;
  bool gated = false;
  bool restarted = false;
  double worst_after = 0.0;
  for (int scan = 0; scan < 70; ++scan) {
    const double t = 0.5 + 0.1 * scan;
    for (; imu_t <= t + 0.1; imu_t += 0.005)
      model->add_imu(wrong_sample(imu_t));
    const Pose truth(so3_exp({0.0, 0.0, turned_deg(t) * kDegree}), Eigen::Vector3d::Zero());
    const TimeNs stamp = from_seconds(t);
    const double off = (model->predict(stamp).world_from_body.inverse() * truth).angle() / kDegree;
    if (restarted) worst_after = std::max(worst_after, off);
    const MotionUpdate update =
        model->add_scan(stamp, scan == 0 ? std::nullopt : std::optional(right_match(truth)));
    restarted = restarted || (gated && update.status == MotionStatus::kAccepted);
    gated = update.status == MotionStatus::kVelocityGate;
  }
  EXPECT_TRUE(restarted);
  EXPECT_LT(worst_after, 1.0);
}

}  // namespace
}  // namespace understory
