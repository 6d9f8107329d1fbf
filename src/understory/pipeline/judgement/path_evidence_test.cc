#include "understory/pipeline/judgement/path_evidence.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "understory/sensor/scan_content.h"

namespace understory {
namespace {

// 10 Hz over 20 s; `at` gives x, y and yaw at a time.
MotionEvidence gathered_motion(const std::function<Eigen::Vector3d(double)>& at,
                               double faster = 1.0) {
  PathEvidence path{MotionLimits()};
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d place = at(0.1 * i * faster);
    path.add(
        {from_seconds(0.1 * i), Pose(so3_exp({0.0, 0.0, place.z()}), {place.x(), place.y(), 0.0})});
  }
  return path.evidence();
}

// A circle of 5 m radius at this speed.
std::function<Eigen::Vector3d(double)> circle(double speed) {
  return [speed](double t) {
    const double angle = speed * t / 5.0;
    return Eigen::Vector3d(5.0 * std::sin(angle), 5.0 * (1.0 - std::cos(angle)), angle);
  };
}

TEST(PathEvidence, KnowsSpeedAccelerationAndTurnRate) {
  const MotionEvidence motion = gathered_motion(circle(2.0));
  EXPECT_EQ(motion.steps, 199U);
  EXPECT_NEAR(motion.speed_p99_m_s, 2.0, 0.01);
  EXPECT_NEAR(motion.acceleration_p95_m_s2, 4.0 / 5.0, 0.01);
  EXPECT_NEAR(motion.acceleration_p99_m_s2, 4.0 / 5.0, 0.01);
  EXPECT_NEAR(motion.turn_rate_p99_deg_s, 2.0 / 5.0 * 180.0 / M_PI, 0.1);
  EXPECT_NEAR(motion.longest_step_s, 0.1, 1e-9);
  EXPECT_EQ(motion.impossible, 0U);
}

// Clouds two seconds apart that are taken to be a tenth of a second apart.
TEST(PathEvidence, AWalkPlayedTwentyTimesTooFastIsImpossible) {
  const auto walk = [](double t) { return Eigen::Vector3d(t, 0.5 * std::sin(0.8 * t), 0.0); };
  EXPECT_EQ(gathered_motion(walk).impossible, 0U);
  EXPECT_GT(gathered_motion(walk, 20.0).impossible, 100U);
}

TEST(PathEvidence, NoiseOfMatchingIsNoAcceleration) {
  const auto noisy = [](double t) {
    return Eigen::Vector3d(t + (std::lround(10.0 * t) % 2 == 0 ? 0.04 : -0.04), 0.0, 0.0);
  };
  EXPECT_EQ(gathered_motion(noisy).impossible, 0U);
}

// Walks at 4 m/s, and slides by 10 m within a second.
TEST(PathEvidence, APathThatSlidesAwayHasJumped) {
  const auto slides = [](double t) {
    const double slide = 10.0 * std::clamp(t - 8.0, 0.0, 1.0);
    return Eigen::Vector3d(4.0 * t + slide, 0.4 * std::sin(90.0 * slide), 0.0);
  };
  const MotionEvidence motion = gathered_motion(slides);
  EXPECT_GT(motion.impossible, 2U);
  EXPECT_NEAR(motion.jump_m, 10.0, 1.5);
  EXPECT_NEAR(to_seconds(motion.jump_stamp), 9.0, 0.3);
}

TEST(PathEvidence, ScansAtWrongPlacesComeBackAndAreNoJump) {
  const auto strays = [](double t) {
    const auto scan = std::lround(10.0 * t);
    return Eigen::Vector3d(4.0 * t + (scan == 60 || scan == 62 || scan == 120 ? 1.7 : 0.0), 0.0,
                           0.0);
  };
  const MotionEvidence motion = gathered_motion(strays);
  EXPECT_GT(motion.impossible, 5U);
  EXPECT_LT(motion.jump_m, 0.3);
}

TEST(PathEvidence, OfNoPathThereIsNothing) {
  EXPECT_EQ(PathEvidence{MotionLimits()}.evidence().steps, 0U);
  EXPECT_EQ(PathEvidence{MotionLimits()}.evidence().fastest_m_s, 0.0);
}

Scan scan_of(float x) {
  Scan scan;
  for (int i = 0; i < 100; ++i)
    scan.points.push_back({x + static_cast<float>(i), 2.0F, 3.0F});
  return scan;
}

TEST(ScanContent, IsTheSameForTheSamePointsAtAnotherTime) {
  Scan later = scan_of(1.0F);
  later.stamp = 5;
  EXPECT_EQ(content_of(scan_of(1.0F)), content_of(later));
  EXPECT_NE(content_of(scan_of(1.0F)), content_of(scan_of(1.001F)));
  later.points.pop_back();
  EXPECT_NE(content_of(scan_of(1.0F)), content_of(later));
}

}  // namespace
}  // namespace understory
