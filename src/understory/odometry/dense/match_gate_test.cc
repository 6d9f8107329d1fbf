#include "understory/odometry/dense/match_gate.h"

#include <gtest/gtest.h>

#include <numbers>

namespace understory {
namespace {

constexpr double kDt = 0.1;  // s between the scans

// A carrier at 1 m/s along x whose prediction is certain; the matches differ from it.
class MatchGateTest : public ::testing::Test {
 protected:
  MatchGateTest() {
    config_.velocity_gate_m_s = 1.0;
    config_.angular_gate_deg_s = 30.0;
    before_.velocity = Eigen::Vector3d::UnitX();
    predicted_.state.stamp = from_seconds(kDt);
    predicted_.state.velocity = before_.velocity;
    predicted_.state.world_from_imu =
        Pose(Eigen::Quaterniond::Identity(), kDt * Eigen::Vector3d::UnitX());
  }

  // A match that is `way_m` beside and turned by `turn_deg`, and changes the velocity by
  // `jump_m_s`.
  [[nodiscard]] GateVerdict judge(double jump_m_s, double way_m, double turn_deg) const {
    ImuState with_match = predicted_.state;
    with_match.velocity.y() += jump_m_s;
    const Eigen::Vector3d turn(0.0, 0.0, turn_deg * std::numbers::pi / 180.0);
    const Pose match =
        predicted_.state.world_from_imu * Pose(so3_exp(turn), Eigen::Vector3d(0.0, way_m, 0.0));
    return judge_match(config_, before_, predicted_, with_match, match, match_covariance_);
  }

  MotionConfig config_;
  ImuState before_;
  MotionPrediction predicted_;
  Matrix6d match_covariance_ = Matrix6d::Zero();
};

TEST_F(MatchGateTest, LetsThroughWhatFits) {
  const GateVerdict verdict = judge(0.9, 0.09, 2.9);
  EXPECT_EQ(verdict.reason, "");
  EXPECT_NEAR(verdict.velocity_jump_m_s, 0.9, 1e-12);
}

TEST_F(MatchGateTest, EachLimitStopsByItself) {
  EXPECT_NE(judge(1.1, 0.0, 0.0).reason.find("velocity"), std::string::npos);
  const GateVerdict far = judge(0.0, 0.11, 0.0);
  EXPECT_NE(far.reason.find("from the prediction"), std::string::npos);
  EXPECT_NEAR(far.velocity_jump_m_s, 1.1, 1e-9) << "the way tells of a velocity, too";
  EXPECT_NE(judge(0.0, 0.0, 3.1).reason.find("turned"), std::string::npos);
}

TEST_F(MatchGateTest, ZeroTurnsALimitOff) {
  config_.velocity_gate_m_s = 0.0;
  EXPECT_EQ(judge(50.0, 5.0, 0.0).reason, "");
  EXPECT_NE(judge(0.0, 0.0, 3.1).reason, "");
  config_.angular_gate_deg_s = 0.0;
  EXPECT_EQ(judge(50.0, 5.0, 90.0).reason, "");
}

// Three standard deviations of the prediction and the limit add up like independent errors.
TEST_F(MatchGateTest, WhatThePredictionDoesNotKnowOpensTheGate) {
  predicted_.covariance.diagonal().segment<3>(6).setConstant(0.5 * 0.5);
  EXPECT_EQ(judge(1.79, 0.0, 0.0).reason, "");
  EXPECT_NE(judge(1.82, 0.0, 0.0).reason, "");
  predicted_.covariance.diagonal().segment<3>(3).setConstant(0.05 * 0.05);
  EXPECT_EQ(judge(0.0, 0.179, 0.0).reason, "");
  EXPECT_NE(judge(0.0, 0.182, 0.0).reason, "");
}

// A match that knows little of the heading does not contradict the prediction.
TEST_F(MatchGateTest, WhatTheMatchDoesNotKnowOpensTheGate) {
  match_covariance_(4, 4) = 0.05 * 0.05;
  EXPECT_EQ(judge(0.0, 0.179, 0.0).reason, "");
  EXPECT_NE(judge(0.0, 0.182, 0.0).reason, "");
  match_covariance_(2, 2) = 0.02 * 0.02;
  EXPECT_EQ(judge(0.0, 0.0, 4.5).reason, "");
  EXPECT_NE(judge(0.0, 0.0, 4.7).reason, "");
}

// P2-8 itself looks at the velocity against the state before, and at nothing else.
TEST_F(MatchGateTest, AgainstThePreviousStateOnlyTheVelocityCounts) {
  config_.velocity_gate_reference = VelocityGateReference::kPreviousState;
  predicted_.state.velocity = Eigen::Vector3d(5.0, 0.0, 0.0);
  EXPECT_NE(judge(0.0, 0.0, 0.0).reason, "") << "4 m/s more than before";
  before_.velocity = Eigen::Vector3d(5.0, 0.0, 0.0);
  EXPECT_EQ(judge(0.0, 3.0, 40.0).reason, "");
}

}  // namespace
}  // namespace understory
