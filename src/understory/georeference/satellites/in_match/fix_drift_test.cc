#include "understory/georeference/satellites/in_match/fix_drift.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <utility>

#include "understory/util/random.h"

namespace understory {
namespace {

using Eigen::Vector3d;

constexpr double kSpeedMS = 3.0;
constexpr double kStepS = 0.1;
constexpr double kStatedM = 0.05;
constexpr double kScanNoiseM = 0.01;

// A carrier that goes straight on. Its path follows each fix that counts, and its local map follows
// the path over the way that a lidar sees. Else it is where the map holds it.
class Carrier {
 public:
  // What is added to the fix, and to the path by scans alone, at a time in seconds.
  using Error = std::function<Vector3d(double)>;
  Carrier(Error of_fix, Error of_scans)
      : of_fix_(std::move(of_fix)), of_scans_(std::move(of_scans)) {}

  void until(double seconds) {
    for (; time_s_ < seconds; time_s_ += kStepS)
      step();
  }
  [[nodiscard]] const FixDrift& drift() const { return drift_; }
  [[nodiscard]] FixDrift& drift() { return drift_; }
  [[nodiscard]] double off_m() const { return off_m_; }
  // Of the path from the truth, metres.
  [[nodiscard]] Vector3d error() const { return error_; }

 private:
  [[nodiscard]] Vector3d truth() const { return {kSpeedMS * time_s_, 0.0, 0.0}; }
  Vector3d noise(double sd) {
    return {random_.normal(0.0, sd), random_.normal(0.0, sd), random_.normal(0.0, sd)};
  }

  void step() {
    const Vector3d fix = truth() + of_fix_(time_s_) + noise(0.5 * kStatedM);
    const Vector3d alone = truth() + of_scans_(time_s_) + map_ + noise(kScanNoiseM);
    antenna_ = off_m_ == 0.0 ? fix : alone;
    drift_.note_pull(alone, antenna_);
    drift_.add_pose(antenna_, false);
    off_m_ = drift_.add_fix({fix, kStatedM * kStatedM * Eigen::Matrix3d::Identity(), antenna_});
    error_ = antenna_ - truth();
    map_ += kSpeedMS * kStepS / 30.0 * (antenna_ - alone);
  }

  Error of_fix_;
  Error of_scans_;
  FixDrift drift_{0.005};
  Random random_{3};
  Vector3d antenna_ = Vector3d::Zero();
  Vector3d map_ = Vector3d::Zero();
  Vector3d error_ = Vector3d::Zero();
  double time_s_ = 0.0;
  double off_m_ = 0.0;
};

Vector3d nothing(double /*seconds*/) {
  return Vector3d::Zero();
}

// From 60 s on, over ten seconds; back again at 90 s.
Vector3d slides(double seconds, const Vector3d& by) {
  if (seconds > 90.0) return Vector3d::Zero();
  return std::clamp((seconds - 60.0) / 10.0, 0.0, 1.0) * by;
}

TEST(FixDrift, AReceiverThatSlidesAwayHasLeftThePathThatFollowsIt) {
  for (const Vector3d& by :
       {Vector3d(0.0, 3.0, 0.0), Vector3d(2.0, -2.0, 0.0), Vector3d(0.0, 0.0, 3.0)}) {
    Carrier carrier([&](double s) { return slides(s, by); }, nothing);
    carrier.until(60.0);
    EXPECT_FALSE(carrier.drift().left()) << by.transpose();
    carrier.until(62.5);
    EXPECT_TRUE(carrier.drift().left()) << by.transpose();
    carrier.until(88.0);
    EXPECT_TRUE(carrier.drift().left()) << "still there: " << by.transpose();
    EXPECT_NEAR(carrier.off_m(), by.norm(), 0.5);
    EXPECT_LT(carrier.error().norm(), 0.2) << "it followed a little at first";
    carrier.until(92.0);
    EXPECT_FALSE(carrier.drift().left()) << "it has come back: " << by.transpose();
    EXPECT_NEAR(carrier.drift().farthest_m(), by.norm(), 0.5);
  }
}

// A new piece of the map does not hide what happened before.
TEST(FixDrift, AFurtherPieceKeepsTheFarthest) {
  Carrier carrier([](double s) { return slides(s, {0.0, 3.0, 0.0}); }, nothing);
  carrier.until(75.0);
  carrier.drift().clear();
  EXPECT_FALSE(carrier.drift().left());
  EXPECT_GT(carrier.drift().farthest_m(), 2.0);
}

// 1.7 % of the way. Each scan is only half a metre off its map, which follows the fixes, too.
TEST(FixDrift, ASlowSlideShowsThoughTheMapFollows) {
  Carrier carrier(
      [](double s) { return Vector3d(std::clamp(0.05 * (s - 60.0), 0.0, 3.0), 0.0, 0.0); },
      nothing);
  carrier.until(60.0);
  EXPECT_FALSE(carrier.drift().left());
  carrier.until(115.0);
  EXPECT_TRUE(carrier.drift().left());
}

// A map that was laid on the globe with a wrong heading leaves the fixes sideways.
TEST(FixDrift, AWrongHeadingIsNoDriftWhereItMayBeThatWrong) {
  for (const double heading_sd_rad : {0.0, 0.02}) {
    FixDrift drift(heading_sd_rad);
    const Eigen::Matrix3d stated = kStatedM * kStatedM * Eigen::Matrix3d::Identity();
    for (int i = 0; i <= 100; ++i) {
      const Vector3d antenna(i, 0.0, 0.0);
      drift.add_pose(antenna, false);
      (void)drift.add_fix({antenna + Vector3d(0.0, 0.026 * i, 0.0), stated, antenna});
    }
    EXPECT_EQ(drift.left(), heading_sd_rad == 0.0);
  }
}

// Fixes are there to take such an error out.
TEST(FixDrift, AnOdometryThatDriftsByAHundredthIsMended) {
  Carrier carrier(nothing, [](double s) { return Vector3d(0.0, 0.01 * kSpeedMS * s, 0.0); });
  for (double seconds = 1.0; seconds < 200.0; seconds += 1.0) {
    carrier.until(seconds);
    ASSERT_FALSE(carrier.drift().left()) << seconds;
  }
  EXPECT_LT(carrier.error().norm(), 0.15);
}

// Two metres in ten, where the points held the scans in some directions only.
TEST(FixDrift, WhereScansAreHeldBadlyTheFixesAreRight) {
  for (const bool loose : {false, true}) {
    FixDrift drift(0.0);
    Vector3d antenna = Vector3d::Zero();
    const Eigen::Matrix3d stated = kStatedM * kStatedM * Eigen::Matrix3d::Identity();
    for (int i = 0; i <= 20; ++i) {
      antenna.x() = i;
      drift.add_pose(antenna, loose && i > 10);
      const Vector3d fix = antenna + Vector3d(0.0, i > 10 ? 0.2 * (i - 10) : 0.0, 0.0);
      (void)drift.add_fix({fix, stated, antenna});
    }
    EXPECT_EQ(drift.left(), !loose);
  }
}

// One blunder that was trusted is not what later fixes are measured by.
TEST(FixDrift, OneWrongFixDoesNotDecide) {
  FixDrift drift(0.0);
  const Eigen::Matrix3d stated = kStatedM * kStatedM * Eigen::Matrix3d::Identity();
  for (int i = 0; i <= 40; ++i) {
    const Vector3d antenna(5.0 * i, 0.0, 0.0);
    drift.add_pose(antenna, false);
    const Vector3d fix = antenna + Vector3d(0.0, i == 20 ? 20.0 : 0.0, 0.0);
    EXPECT_EQ(drift.add_fix({fix, stated, antenna}) > 0.0, i == 20) << i;
  }
}

TEST(FixDrift, MovesWithTheWorldAndGoesOnFromItsState) {
  const Vector3d by(0.0, 3.0, 0.0);
  Carrier carrier([&](double s) { return slides(s, by); }, nothing);
  carrier.until(75.0);
  ASSERT_TRUE(carrier.drift().left());
  BinaryWriter writer;
  carrier.drift().save(writer);
  BinaryReader reader(writer.bytes(), "state");
  FixDrift loaded(0.005);
  loaded.load(reader);
  const Pose turn(Eigen::Quaterniond(Eigen::AngleAxisd(1.0, Vector3d::UnitZ())), {5.0, 6.0, 7.0});
  loaded.move(turn, turn);
  const FixAtAntenna fix{
      {240.0, 3.0, 0.0}, 0.0025 * Eigen::Matrix3d::Identity(), {240.0, 0.2, 0.0}};
  FixAtAntenna turned = fix;
  turned.fix_in_world = turn * fix.fix_in_world;
  turned.antenna_in_world = turn * fix.antenna_in_world;
  const double off_m = carrier.drift().add_fix(fix);
  EXPECT_GT(off_m, 2.0);
  EXPECT_NEAR(loaded.add_fix(turned), off_m, 1e-9);
}

}  // namespace
}  // namespace understory
