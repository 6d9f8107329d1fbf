#include "understory/odometry/imu/imu_watch.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

namespace understory {
namespace {

constexpr TimeNs kStep = kNsPerSecond / 10;

// A sensor that stands level and turns about the vertical at 1 rad/s; what the gyroscope says of it
// is multiplied by `gyro_scale`.
class ImuWatchTest : public ::testing::Test {
 protected:
  ImuWatchTest()
      : log_([this](LogLevel, const std::string& message) { said_.push_back(message); }),
        watch_(9.81, &log_) {}

  [[nodiscard]] ImuMatch match_at(TimeNs stamp) const {
    const Eigen::Vector3d turn(0.0, 0.0, match_rate_ * to_seconds(stamp));
    return {stamp, Pose(so3_exp(turn), Eigen::Vector3d::Zero()), match_sigma_};
  }

  // Turns until `to`, or until the IMU is used again; says when that was.
  TimeNs turn(TimeNs from, TimeNs to, double gyro_scale, bool until_usable = false) {
    TimeNs at = from;
    for (; at < to && !(until_usable && watch_.usable()); at += kStep) {
      std::vector<InertialSample> samples;
      for (const TimeNs stamp : {at, at + kStep / 2, at + kStep})
        samples.push_back({stamp, {0.0, 0.0, gyro_scale}, {0.0, 0.0, 9.81}});
      watch_.pass_time(at + kStep);
      watch_.compare(match_at(at), match_at(at + kStep), samples);
    }
    return at;
  }

  [[nodiscard]] std::size_t warned(const std::string& key) const {
    for (const Log::Warning& warning : log_.warnings()) {
      if (warning.key == key) return warning.count;
    }
    return 0;
  }

  double match_rate_ = 1.0;   // as matching sees it, rad/s
  double match_sigma_ = 0.0;  // rad
  std::vector<std::string> said_;
  Log log_;
  ImuWatch watch_;
};

TEST_F(ImuWatchTest, SilenceIsSaidOncePerStretch) {
  for (const bool any : {true, false, false, false, true, false, true})
    watch_.note_samples(any, 0, kStep);
  EXPECT_EQ(warned("imu.silent"), 2U);
}

TEST_F(ImuWatchTest, TimeWithoutSamplesIsSummedUp) {
  for (const bool any : {true, false, false, true, false})
    watch_.note_samples(any, 0, kStep);
  EXPECT_DOUBLE_EQ(watch_.trust().without_samples_s, 3.0 * to_seconds(kStep));
}

TEST_F(ImuWatchTest, AnImuThatIsLeftOutIsNotCalledSilent) {
  watch_.suspect(0);
  watch_.note_samples(false, 0, kStep);
  EXPECT_EQ(warned("imu.silent"), 0U);
}

TEST_F(ImuWatchTest, ProbationWithoutAVerdictEndsForTheImu) {
  watch_.suspect(0);
  EXPECT_FALSE(watch_.usable());
  EXPECT_TRUE(watch_.trust().on_probation);
  watch_.suspect(kStep);  // no news
  EXPECT_EQ(warned("imu.probation"), 1U);
  watch_.pass_time(19 * kNsPerSecond);
  EXPECT_FALSE(watch_.usable());
  watch_.pass_time(21 * kNsPerSecond);
  EXPECT_TRUE(watch_.usable());
  ASSERT_EQ(said_.size(), 2U);
  EXPECT_NE(said_.back().find("used again"), std::string::npos) << said_.back();
}

TEST_F(ImuWatchTest, AgreementEndsProbationAndProves) {
  watch_.suspect(0);
  turn(0, 8 * kNsPerSecond, 1.0);
  EXPECT_TRUE(watch_.usable());
  EXPECT_TRUE(watch_.trust().proven);
  EXPECT_TRUE(watch_.trust().trusted);
}

// Bug: when the scan matches keep contradicting an IMU that had passed its probation, it lost trust
// without a word in the log.
TEST_F(ImuWatchTest, SuspicionAfterProbationIsSaid) {
  watch_.suspect(0);
  const TimeNs passed = turn(0, 8 * kNsPerSecond, 1.0, true);
  ASSERT_TRUE(watch_.usable());
  watch_.suspect(passed);
  EXPECT_FALSE(watch_.trust().trusted);
  EXPECT_EQ(warned("imu.untrusted"), 1U);
  EXPECT_NE(said_.back().find("accelerometer"), std::string::npos) << said_.back();
}

TEST_F(ImuWatchTest, AWrongScaleIsSaidOnceAndStays) {
  turn(0, 20 * kNsPerSecond, 57.3);
  EXPECT_FALSE(watch_.trust().trusted);
  EXPECT_EQ(warned("imu.untrusted"), 1U);
  turn(20 * kNsPerSecond, 30 * kNsPerSecond, 1.0);
  EXPECT_FALSE(watch_.trust().trusted);
}

// Bug: rings of 16 beams on even ground matched as if the carrier stood still, and the gyroscope
// was doubted.
TEST_F(ImuWatchTest, MatchesThatDoNotKnowTheHeadingSayNothingOfTheGyroscope) {
  match_rate_ = 0.0;
  match_sigma_ = 0.1;
  turn(0, 20 * kNsPerSecond, 0.3);
  EXPECT_TRUE(watch_.usable());
  EXPECT_TRUE(watch_.trust().trusted);
  EXPECT_FALSE(watch_.trust().proven);
  match_sigma_ = 0.01;
  turn(20 * kNsPerSecond, 30 * kNsPerSecond, 0.3);
  EXPECT_FALSE(watch_.usable());
}

TEST_F(ImuWatchTest, SavedInAStretchOfSilenceItDoesNotSayItAgain) {
  watch_.note_samples(false, 0, kStep);
  BinaryWriter writer;
  watch_.save(writer);
  ImuWatch again(9.81, &log_);
  BinaryReader reader(writer.bytes(), "test");
  again.load(reader);
  again.note_samples(false, kStep, 2 * kStep);
  EXPECT_EQ(warned("imu.silent"), 1U);
}

// Matches that say nothing of a turn contradicted it, and a run before this one found it right.
TEST_F(ImuWatchTest, NothingIsHeldAgainstAnImuThatIsVouchedFor) {
  watch_.vouch_until(10 * kNsPerSecond);
  EXPECT_TRUE(watch_.trust().proven);
  match_rate_ = 0.0;
  turn(0, 9 * kNsPerSecond, 1.0);
  watch_.suspect(9 * kNsPerSecond);
  EXPECT_TRUE(watch_.usable());
  EXPECT_TRUE(watch_.trust().trusted);
  EXPECT_TRUE(watch_.vouched_for(10 * kNsPerSecond));
  EXPECT_FALSE(watch_.vouched_for(10 * kNsPerSecond + 1));
  match_rate_ = 1.0;  // what was said before does not count now
  turn(11 * kNsPerSecond, 20 * kNsPerSecond, 1.0);
  EXPECT_TRUE(watch_.trust().trusted);
}

TEST_F(ImuWatchTest, AnImuThatWasVouchedForIsJudgedAfterThat) {
  watch_.vouch_until(10 * kNsPerSecond);
  watch_.pass_time(11 * kNsPerSecond);
  watch_.suspect(11 * kNsPerSecond);
  EXPECT_FALSE(watch_.trust().trusted);  // its turns were right, so its accelerations are not
}

TEST_F(ImuWatchTest, TheTimeInDoubtIsSummedUp) {
  EXPECT_EQ(watch_.trust().doubted_s, 0.0);
  watch_.suspect(0);
  const TimeNs used_again = turn(0, 20 * kNsPerSecond, 1.0, true);
  EXPECT_NEAR(watch_.trust().doubted_s, to_seconds(used_again), 0.15);
  turn(used_again, used_again + 5 * kNsPerSecond, 1.0);
  EXPECT_NEAR(watch_.trust().doubted_s, to_seconds(used_again), 0.15);
}

}  // namespace
}  // namespace understory
