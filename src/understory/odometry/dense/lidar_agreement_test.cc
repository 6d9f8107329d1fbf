#include "understory/odometry/dense/lidar_agreement.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/util/random.h"

namespace understory {
namespace {

constexpr TimeNs kTenth = 100'000'000;  // 0.1 s

Vector6d noise(Random& random, double sd) {
  Vector6d values;
  for (int i = 0; i < 6; ++i)
    values[i] = sd * random.normal();
  return values;
}

// A body that goes forward and sideways at a speed that changes, and turns.
Vector6d speed_at(int i) {
  Vector6d speed;
  speed << 0.0, 0.0, 2.0 * std::sin(0.7 * i), 1.0 + 0.5 * std::sin(0.3 * i),
      0.2 * std::cos(0.5 * i), 0.0;
  return speed;
}

TEST(LidarOffsetSums, AClockShowsInWhatChangesWithTheMotion) {
  Random random(1);
  LidarOffsetSums sums;
  for (int i = 0; i < 30; ++i)
    sums.add(noise(random, 0.002) - 0.04 * speed_at(i), speed_at(i));
  const auto offset = sums.offset(2);
  ASSERT_TRUE(offset);
  EXPECT_EQ(offset->lidar, 2U);
  EXPECT_EQ(offset->probes, 30);
  EXPECT_NEAR(offset->late_s, 0.04, 4.0 * offset->late_sd_s);
  EXPECT_LT(offset->late_sd_s, 0.001);
  EXPECT_GT(offset->late_sd_s, 0.0001);
  EXPECT_TRUE(offset->clock_is_off());
  EXPECT_FALSE(offset->place_is_off());
  double squares = 0.0;
  for (int i = 0; i < 30; ++i)
    squares += (0.04 * speed_at(i)).squaredNorm() / 30.0;
  EXPECT_NEAR(offset->apart_m, std::sqrt(squares), 0.002);
}

TEST(LidarOffsetSums, AWrongPlaceShowsInWhatDoesNotChange) {
  Random random(2);
  LidarOffsetSums sums;
  Vector6d place = Vector6d::Zero();
  place << 0.0, 0.0, 0.03, 0.0, 0.04, 0.0;
  for (int i = 0; i < 30; ++i)
    sums.add(place + noise(random, 0.002), speed_at(i));
  const auto offset = sums.offset(1);
  ASSERT_TRUE(offset);
  EXPECT_NEAR(offset->misplaced_m, 0.05, 0.003);
  EXPECT_NEAR(offset->apart_m, 0.05, 0.003);
  EXPECT_TRUE(offset->place_is_off());
  EXPECT_FALSE(offset->clock_is_off());
}

TEST(LidarOffsetSums, LidarsThatAgreeAreNotDoubted) {
  Random random(3);
  LidarOffsetSums sums;
  for (int i = 0; i < 8; ++i) {
    EXPECT_FALSE(sums.offset(1)) << i;
    sums.add(noise(random, 0.01), speed_at(i));
  }
  const auto offset = sums.offset(1);
  ASSERT_TRUE(offset);
  EXPECT_FALSE(offset->clock_is_off());
  EXPECT_FALSE(offset->place_is_off());
}

// One even motion does not tell clock and place apart, but that the points lie apart.
TEST(LidarOffsetSums, AnEvenMotionTellsNoCause) {
  Random random(4);
  LidarOffsetSums sums;
  Vector6d even = Vector6d::Zero();
  even[3] = 1.5;
  for (int i = 0; i < 20; ++i)
    sums.add(noise(random, 0.003) - 0.04 * even, even + noise(random, 0.001));
  const auto offset = sums.offset(1);
  ASSERT_TRUE(offset);
  EXPECT_FALSE(offset->clock_is_off());
  EXPECT_FALSE(offset->place_is_off());
  EXPECT_NEAR(offset->apart_m, 0.06, 0.005);
}

// Scans every 0.1 s along x at 1 m/s.
StampedPose pose_at(int scan, double speed_m_s = 1.0) {
  return {1 + scan * kTenth,
          Pose(Eigen::Quaterniond::Identity(), {0.1 * speed_m_s * scan, 0.0, 0.0})};
}

TEST(LidarAgreement, LooksAtEachFifthScanOfABodyThatMoves) {
  LidarAgreement moving;
  int looked = 0;
  for (int scan = 0; scan < 101; ++scan)
    looked += moving.wants(pose_at(scan)) ? 1 : 0;
  EXPECT_EQ(looked, 20);
  LidarAgreement standing;
  for (int scan = 0; scan < 101; ++scan)
    EXPECT_FALSE(standing.wants(pose_at(scan, 0.1)));
  // Over a gap the speed is not known.
  LidarAgreement interrupted;
  for (int scan = 0; scan < 101; ++scan) {
    interrupted.interrupt();
    EXPECT_FALSE(interrupted.wants(pose_at(scan)));
  }
  LidarAgreement sparse;
  for (int scan = 0; scan < 101; ++scan)
    EXPECT_FALSE(sparse.wants(pose_at(6 * scan)));
}

// Of three lidars the second is right, and the third lies 6 cm off.
LidarAgreement agreement_of_three(int probes) {
  LidarAgreement agreement;
  int seen = 0;
  for (int scan = 0; seen < probes; ++scan) {
    if (!agreement.wants(pose_at(scan))) continue;
    ++seen;
    const Pose first = pose_at(scan).world_from_body;
    const Pose third = first * Pose(Eigen::Quaterniond::Identity(), {0.0, 0.0, 0.06});
    agreement.add({first, first, third});
    agreement.add({std::nullopt, first, third});  // says nothing of the first one
  }
  return agreement;
}

TEST(LidarAgreement, NamesTheLidarThatLiesFarthestOff) {
  EXPECT_FALSE(agreement_of_three(7).worst());
  const auto worst = agreement_of_three(8).worst();
  ASSERT_TRUE(worst);
  EXPECT_EQ(worst->lidar, 2U);
  EXPECT_EQ(worst->probes, 8);
  EXPECT_NEAR(worst->apart_m, 0.06, 1e-9);
}

TEST(LidarAgreement, GoesOnFromACheckpoint) {
  LidarAgreement agreement = agreement_of_three(9);
  BinaryWriter writer;
  agreement.save(writer);
  LidarAgreement again;
  BinaryReader reader(writer.bytes(), "checkpoint");
  again.load(reader);
  EXPECT_EQ(again.worst()->apart_m, agreement.worst()->apart_m);
  EXPECT_EQ(again.worst()->probes, 9);
  // A scan that is looked at after five more, and the world moved in between.
  const Pose aside(Eigen::Quaterniond::Identity(), {0.0, 300.0, 0.0});
  for (LidarAgreement* one : {&agreement, &again}) {
    one->move_world(aside);
    int scans = 0;
    for (bool wanted = false; !wanted; ++scans) {
      StampedPose pose = pose_at(46 + scans);
      pose.world_from_body = aside * pose.world_from_body;
      wanted = one->wants(pose);
    }
    EXPECT_EQ(scans, 5);
  }
}

}  // namespace
}  // namespace understory
