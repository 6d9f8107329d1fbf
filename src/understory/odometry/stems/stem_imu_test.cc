#include "understory/odometry/stems/stem_imu.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "understory/util/angles.h"

namespace understory {
namespace {

// An IMU with its z axis forward, on a body that stands pitched by 5 degrees and turns to and fro
// about the vertical. Its gyroscope has a bias.
struct Swing {
  Pose body_from_imu{so3_exp(Eigen::Vector3d(0.0, 0.5 * std::numbers::pi, 0.0)),
                     Eigen::Vector3d(0.3, 0.0, 1.0)};
  Eigen::Vector3d bias{0.01, -0.02, 0.015};  // body axes

  [[nodiscard]] static Eigen::Quaterniond world_from_body(double t) {
    return so3_exp(Eigen::Vector3d(0.0, 0.0, 0.5 * std::sin(0.8 * t))) *
           so3_exp(Eigen::Vector3d(0.0, 5.0 * kDegree, 0.0));
  }
  [[nodiscard]] ImuSample at(double t) const {
    const Eigen::Quaterniond body_from_world = world_from_body(t).conjugate();
    const Eigen::Vector3d rate =
        body_from_world * Eigen::Vector3d(0.0, 0.0, 0.4 * std::cos(0.8 * t)) + bias;
    // Starting and braking, which gravity alone would not show.
    const Eigen::Vector3d force = body_from_world * Eigen::Vector3d(std::cos(2.0 * t), 0.0, 9.81);
    ImuSample sample;
    sample.stamp = from_seconds(t);
    sample.angular_rate = body_from_imu.rotation().conjugate() * rate;
    sample.specific_force = body_from_imu.rotation().conjugate() * force;
    return sample;
  }
};

Scan two_point_scan(double t) {
  Scan scan;
  scan.stamp = from_seconds(t);
  scan.points.resize(2);
  scan.points[1].t_ns = 50'000'000;
  return scan;
}

double angle_deg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) / kDegree;
}

TEST(StemImu, TellsTurnsUpAndItsOwnBias) {
  const Swing swing;
  StemImu imu({});
  ImuBuffer samples({}, nullptr);
  StemUp last;
  for (int k = 0; k < 600; ++k) {
    const double t = 0.2 * k;
    for (int i = 0; i < 40; ++i)
      samples.add(swing.at(t + 0.005 * i));
    const Scan scan = two_point_scan(t + 0.1);
    if (k == 0) continue;
    const auto motion = imu.motion(samples, from_seconds(t - 0.1), scan, swing.body_from_imu);
    ASSERT_TRUE(motion);
    EXPECT_NEAR(motion->seconds, 0.2, 1e-9);
    const Eigen::Quaterniond truth =
        swing.world_from_body(t - 0.1).conjugate() * swing.world_from_body(t + 0.1);
    if (k > 500) {
      EXPECT_LT(motion->previous_from_now.angularDistance(truth), 0.03 * kDegree);
      const Eigen::Vector3d rate = swing.world_from_body(t + 0.125).conjugate() *
                                   Eigen::Vector3d(0.0, 0.0, 0.4 * std::cos(0.8 * (t + 0.125)));
      EXPECT_LT((motion->rate_in_scan - rate).norm(), 0.01);
    }
    StemUp by_stems;  // leans by a degree, as stands do
    by_stems.up_in_body = swing.world_from_body(t + 0.1).conjugate() *
                          Eigen::Vector3d(std::tan(1.0 * kDegree), 0.0, 1.0).normalized();
    by_stems.spread_rad = 3.0 * kDegree;
    by_stems.stems = 100;
    last = imu.up(by_stems, *motion);
    imu.take(*motion, truth);
    samples.forget_before(scan.stamp);
    if (k < 300) continue;
    const Eigen::Vector3d up =
        swing.world_from_body(t + 0.1).conjugate() * Eigen::Vector3d::UnitZ();
    EXPECT_LT(angle_deg(last.up_in_body, up), 0.6);
    EXPECT_GT(angle_deg(last.up_in_body, up), 0.1);  // the stems have their say
  }
  EXPECT_LT((imu.gyro_bias() - swing.bias).norm(), 0.001);
  EXPECT_LT(last.sd_rad, 0.3 * kDegree);
  EXPECT_GT(last.sd_rad, 0.1 * kDegree);
  // Samples that do not reach are no motion.
  EXPECT_FALSE(
      imu.motion(samples, from_seconds(300.0), two_point_scan(300.2), swing.body_from_imu));
  // After a pause up is not known as well as before.
  imu.forget();
  StemImu::Motion still;
  still.mean_force = Eigen::Vector3d(0.0, 0.0, 9.81);
  still.seconds = 0.2;
  EXPECT_GT(imu.up({}, still).sd_rad, 2.0 * kDegree);
  EXPECT_LT(angle_deg(imu.up({}, still).up_in_body, Eigen::Vector3d::UnitZ()), 1e-6);
}

}  // namespace
}  // namespace understory
