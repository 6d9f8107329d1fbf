#include "understory/odometry/dense/recovery.h"

#include <gtest/gtest.h>

#include <limits>

namespace understory {
namespace {

DenseEstimate estimate_at(double x, double inliers) {
  DenseEstimate estimate;
  estimate.state.world_from_body = Pose(so3_exp({0.0, 0.0, 0.5 * M_PI}), {x, 0.0, 0.0});
  estimate.state.velocity_in_world = {0.0, 2.0, 0.0};
  estimate.matched = inliers > 0.0;
  estimate.match.inlier_ratio = inliers;
  estimate.update.status = estimate.matched ? MotionStatus::kAccepted : MotionStatus::kPredicted;
  return estimate;
}

TEST(Recovery, UnmatchedScansInARowAreALoss) {
  const Recovery recovery(30);
  EXPECT_FALSE(recovery.lost(estimate_at(1.0, 0.0), 28));
  EXPECT_TRUE(recovery.lost(estimate_at(1.0, 0.0), 29));
  EXPECT_FALSE(recovery.lost(estimate_at(1.0, 0.9), 29));
  DenseEstimate gated = estimate_at(1.0, 0.9);
  gated.update.status = MotionStatus::kVelocityGate;
  EXPECT_TRUE(recovery.lost(gated, 29));
}

TEST(Recovery, AStateThatNoCarrierHasIsALossAtOnce) {
  const Recovery recovery(30);
  DenseEstimate fast = estimate_at(1.0, 0.9);
  fast.state.velocity_in_world = {0.0, 101.0, 0.0};
  EXPECT_TRUE(recovery.lost(fast, 0));
  DenseEstimate broken = estimate_at(std::numeric_limits<double>::quiet_NaN(), 0.9);
  EXPECT_TRUE(recovery.lost(broken, 0));
}

// A match by chance finds few of the points again.
TEST(Recovery, AfterAnOutageAMatchHasToFindHalfOfTheUsualPoints) {
  Recovery recovery(30);
  EXPECT_FALSE(recovery.lost_over_outage(from_seconds(100.0), estimate_at(1.0, 0.1)));
  recovery.note_scan(from_seconds(10.0));
  recovery.note_good(estimate_at(1.0, 0.8));
  EXPECT_FALSE(recovery.is_outage(from_seconds(10.9)));
  EXPECT_FALSE(recovery.lost_over_outage(from_seconds(10.9), estimate_at(1.0, 0.1)));
  EXPECT_TRUE(recovery.is_outage(from_seconds(11.1)));
  EXPECT_TRUE(recovery.lost_over_outage(from_seconds(11.1), estimate_at(1.0, 0.39)));
  EXPECT_FALSE(recovery.lost_over_outage(from_seconds(11.1), estimate_at(1.0, 0.41)));
  EXPECT_TRUE(recovery.lost_over_outage(from_seconds(11.1), estimate_at(1.0, 0.0)));
  recovery.forget_matches();
  EXPECT_FALSE(recovery.lost_over_outage(from_seconds(11.1), estimate_at(1.0, 0.0)));
}

// Blind for 3 s: the first scan that sees half around is not matched. Were it taken for the place
// where the carrier was last, the map would break there.
TEST(Recovery, AfterABlindTimeACertainPredictionWaitsForTheNextScan) {
  NavState predicted;
  predicted.pose_covariance = Eigen::Matrix<double, 6, 6>::Identity() * 0.2 * 0.2;
  Recovery recovery(30);
  recovery.note_scan(from_seconds(10.0));
  recovery.note_good(estimate_at(1.0, 0.8));
  EXPECT_FALSE(recovery.waits(predicted, estimate_at(1.0, 0.0)));  // nothing was blind
  for (double time = 10.1; time < 13.0; time += 0.1)
    recovery.note_scan(from_seconds(time), false);
  EXPECT_TRUE(recovery.is_outage(from_seconds(13.0)));
  EXPECT_TRUE(recovery.lost_over_outage(from_seconds(13.0), estimate_at(1.0, 0.39)));
  EXPECT_FALSE(recovery.waits(predicted, estimate_at(1.0, 0.39)));  // a match is judged at once
  NavState uncertain = predicted;
  uncertain.pose_covariance *= 26.0;
  EXPECT_FALSE(recovery.waits(uncertain, estimate_at(1.0, 0.0)));
  for (int i = 0; i < 5; ++i) {
    EXPECT_TRUE(recovery.waits(predicted, estimate_at(1.0, 0.0)));
    recovery.note_scan(from_seconds(13.0 + 0.1 * i), false);
  }
  EXPECT_FALSE(recovery.waits(predicted, estimate_at(1.0, 0.0)));
  recovery.note_scan(from_seconds(13.5));
  EXPECT_FALSE(recovery.is_outage(from_seconds(13.6)));
}

TEST(Recovery, APredictionThatIsWorthNothingGivesWayToTheLastPlace) {
  Recovery recovery(30);
  recovery.note_good(estimate_at(7.0, 0.8));
  EXPECT_LT((recovery.last_velocity_in_body() - Eigen::Vector3d(2.0, 0.0, 0.0)).norm(), 1e-12);
  NavState predicted;
  predicted.world_from_body = Pose(so3_exp({0.0, 0.0, 0.0}), {9.0, 0.0, 0.0});
  predicted.pose_covariance(4, 4) = 9.9 * 9.9;
  EXPECT_EQ(recovery.place_after_outage(predicted).translation().x(), 9.0);
  predicted.pose_covariance(4, 4) = 10.1 * 10.1;
  EXPECT_EQ(recovery.place_after_outage(predicted).translation().x(), 7.0);
}

TEST(Recovery, GoesOnFromItsSavedState) {
  Recovery recovery(30);
  recovery.note_scan(from_seconds(10.0));
  recovery.note_good(estimate_at(7.0, 0.8));
  BinaryWriter writer;
  recovery.save(writer);
  BinaryReader reader(writer.bytes(), "state");
  Recovery again(30);
  again.load(reader);
  EXPECT_EQ(again.last_scan(), recovery.last_scan());
  EXPECT_EQ(again.last_good().matrix(), recovery.last_good().matrix());
  EXPECT_EQ(again.last_velocity_in_body(), recovery.last_velocity_in_body());
  EXPECT_TRUE(again.lost_over_outage(from_seconds(12.0), estimate_at(1.0, 0.39)));
}

}  // namespace
}  // namespace understory
