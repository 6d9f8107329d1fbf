#include "understory/georeference/satellites/online_georeference.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <string>
#include <vector>

#include "understory/util/random.h"

namespace understory {
namespace {

using Eigen::Vector3d;

constexpr double kDegree = M_PI / 180.0;
const GeodeticPlace kWalkPlace{62.9, 27.4, 140.0};
const Vector3d kWalkArm(0.3, -0.2, 1.1);
const Vector3d kWalkLine(0.4, 0.9, 0.05);  // to the second antenna
const Pose kEnuFromWalk(Eigen::Quaterniond(Eigen::AngleAxisd(-2.4, Vector3d::UnitZ())),
                        Vector3d(20.0, 5.0, -3.0));

// A walk in bends, a pose each 0.1 s, 1 m/s after ten seconds of standing.
Pose walker_at(double time_s) {
  const double way_m = std::max(0.0, time_s - 10.0);
  const Vector3d place(way_m, 15.0 * std::sin(0.04 * way_m), 0.5 * std::sin(0.1 * way_m));
  return {Eigen::Quaterniond(
              Eigen::AngleAxisd(std::atan(0.6 * std::cos(0.04 * way_m)), Vector3d::UnitZ())),
          place};
}

struct TwoAntennaReceiver {
  double slow_m = 0.0;
  double fast_m = 0.02;
  double correlation_s = 60.0;
  double stated_m = 0.05;
  bool heights = true;
  bool headings = false;   // of a second antenna
  double wrong_deg = 0.0;  // that they all are off
};

// A walk with fixes each half second, step by step.
class WalkWithFixes {
 public:
  WalkWithFixes(const TwoAntennaReceiver& receiver, std::uint64_t seed,
                const OnlineGeoreferenceConfig& config = {})
      : receiver_(receiver), random_(seed), online_(config) {
    slow_ = normal();
  }

  GlobalPose step() {
    const double time_s = 0.1 * steps_;
    if (steps_ % 5 == 0) online_.add_fix(fix_at(time_s), kWalkArm, Vector3d(kWalkArm + kWalkLine));
    ++steps_;
    return online_.add_pose({stamp(time_s), world_from_first_ * walker_at(time_s)});
  }
  GlobalPose until(double time_s) {
    GlobalPose pose;
    while (0.1 * steps_ <= time_s)
      pose = step();
    return pose;
  }
  // As a loop closure does.
  void move_world(const Pose& motion) {
    world_from_first_ = motion * world_from_first_;
    online_.move_world(motion);
  }
  // As an odometry does that has lost its way.
  void begin_piece() {
    world_from_first_ = Pose(so3_exp(Vector3d(0.0, 0.0, 1.0)), Vector3d(-40.0, 3.0, 0.0));
    online_.begin_piece();
  }
  void go_on_with(const OnlineGeoreference& other) { online_ = other; }
  [[nodiscard]] const OnlineGeoreference& online() const { return online_; }
  OnlineGeoreference& online() { return online_; }
  [[nodiscard]] double time_s() const { return 0.1 * (steps_ - 1); }  // of the last pose

  // East, north, up; then turns about these axes in degrees.
  [[nodiscard]] Eigen::Matrix<double, 6, 1> error(const GlobalPose& pose) const {
    const Pose truth = kEnuFromWalk * walker_at(time_s());
    Eigen::Matrix<double, 6, 1> error;
    error << EastNorthUp(kWalkPlace).from_place(pose.place) - truth.translation(),
        so3_log(pose.enu_from_body * truth.rotation().conjugate()) / kDegree;
    return error;
  }

  static TimeNs stamp(double time_s) { return 1000 * kNsPerSecond + from_seconds(time_s); }

 private:
  Vector3d normal() {
    const double x = random_.normal();
    const double y = random_.normal();
    return {x, y, random_.normal()};
  }
  GnssFix fix_at(double time_s) {
    const double kept = std::exp(-0.5 / receiver_.correlation_s);
    slow_ = kept * slow_ + std::sqrt(1.0 - kept * kept) * normal();
    const Vector3d error = receiver_.slow_m * slow_ + receiver_.fast_m * normal();
    const GeodeticPlace place =
        EastNorthUp(kWalkPlace).to_place(kEnuFromWalk * (walker_at(time_s) * kWalkArm) + error);
    GnssFix fix;
    fix.stamp = stamp(time_s);
    fix.latitude_deg = place.latitude_deg;
    fix.longitude_deg = place.longitude_deg;
    fix.height_m = receiver_.heights ? place.height_m : std::nan("");
    fix.covariance = std::pow(receiver_.stated_m, 2.0) * Eigen::Matrix3d::Identity();
    fix.quality = 1;
    if (receiver_.headings) {
      const Vector3d line = kEnuFromWalk.rotation() * (walker_at(time_s).rotation() * kWalkLine);
      fix.heading_deg =
          std::fmod(std::atan2(line.x(), line.y()) / kDegree + receiver_.wrong_deg + 720.0, 360.0);
      fix.heading_sd_deg = 0.4;
    }
    return fix;
  }

  TwoAntennaReceiver receiver_;
  Random random_;
  OnlineGeoreference online_;
  Vector3d slow_;
  Pose world_from_first_;
  int steps_ = 0;
};

TEST(OnlineGeoreference, TheHeadingIsKnownOnceTheBodyHasWalked) {
  WalkWithFixes walk({}, 1);
  const GlobalPose first = walk.step();
  EXPECT_FALSE(first.known);
  EXPECT_TRUE(std::isnan(first.place.latitude_deg));
  const GlobalPose standing = walk.until(9.0);
  EXPECT_TRUE(standing.known);
  EXPECT_TRUE(standing.height_known);
  EXPECT_FALSE(standing.heading_known);
  EXPECT_TRUE(std::isnan(standing.turn_sd_deg.z()));
  const GlobalPose walked = walk.until(60.0);
  ASSERT_TRUE(walked.heading_known);
  EXPECT_LT(walk.error(walked).head<3>().norm(), 0.1);
  EXPECT_LT(std::abs(walk.error(walked)(5)), 0.3);
  EXPECT_LT(walk.error(walked).segment<2>(3).norm(), 0.2);
  EXPECT_LT(walked.place_sd_m.maxCoeff(), 0.3);
  EXPECT_EQ(walked.stamp, WalkWithFixes::stamp(60.0));
}

// What is not received yet has no say.
TEST(OnlineGeoreference, AFixAfterThePoseDoesNotCount) {
  WalkWithFixes walk({}, 2);
  WalkWithFixes other({}, 2);
  (void)walk.until(40.0);
  (void)other.until(40.0);
  GnssFix later;
  later.stamp = WalkWithFixes::stamp(40.35);
  later.latitude_deg = kWalkPlace.latitude_deg + 0.01;
  later.longitude_deg = kWalkPlace.longitude_deg;
  later.quality = 1;
  other.online().add_fix(later, kWalkArm);
  const GlobalPose one = walk.step();
  const GlobalPose two = other.step();
  EXPECT_EQ(one.place.latitude_deg, two.place.latitude_deg);
  EXPECT_EQ(one.place_sd_m, two.place_sd_m);
}

TEST(OnlineGeoreference, StatedErrorsHoldFromTheFirstScanOn) {
  Eigen::Matrix<double, 6, 1> known = Eigen::Matrix<double, 6, 1>::Zero();
  Eigen::Matrix<double, 6, 1> within = known;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    WalkWithFixes walk({2.0, 0.3, 20.0 + 10.0 * static_cast<double>(seed), 1.0, true}, seed);
    for (int step = 0; step < 2000; ++step) {
      const GlobalPose pose = walk.step();
      if (!pose.known) continue;
      const auto error = walk.error(pose);
      Eigen::Matrix<double, 6, 1> sd;
      sd << pose.place_sd_m, pose.turn_sd_deg;
      for (int i = 0; i < 6; ++i) {
        if (!std::isfinite(sd(i))) continue;
        known(i) += 1.0;
        within(i) += std::abs(error(i)) <= 3.0 * sd(i) ? 1.0 : 0.0;
      }
    }
  }
  for (int i = 0; i < 6; ++i) {
    EXPECT_GT(known(i), 12'000.0);
    EXPECT_GT(within(i) / known(i), 0.99) << "degree of freedom " << i;
  }
}

TEST(OnlineGeoreference, AWorldThatIsMovedMovesNothingOnTheGlobe) {
  WalkWithFixes walk({}, 4);
  WalkWithFixes moved({}, 4);
  (void)walk.until(80.0);
  (void)moved.until(80.0);
  moved.move_world(Pose(so3_exp(Vector3d(0.0, 0.0, 0.3)), Vector3d(5.0, -2.0, 1.0)));
  const GlobalPose one = walk.until(120.0);
  const GlobalPose two = moved.until(120.0);
  EXPECT_LT((walk.error(one) - moved.error(two)).norm(), 1e-5);
}

TEST(OnlineGeoreference, ANewPieceOfMapIsFoundAnew) {
  WalkWithFixes walk({}, 5);
  ASSERT_TRUE(walk.until(60.0).heading_known);
  walk.begin_piece();
  EXPECT_FALSE(walk.step().known);
  const GlobalPose again = walk.until(120.0);
  ASSERT_TRUE(again.heading_known);
  EXPECT_LT(walk.error(again).head<3>().norm(), 0.15);
}

TEST(OnlineGeoreference, WithoutHeightsThePlaneIsKnown) {
  TwoAntennaReceiver receiver;
  receiver.heights = false;
  WalkWithFixes walk(receiver, 6);
  const GlobalPose pose = walk.until(60.0);
  EXPECT_TRUE(pose.heading_known);
  EXPECT_FALSE(pose.height_known);
  EXPECT_TRUE(std::isnan(pose.place.height_m));
  EXPECT_TRUE(std::isnan(pose.place_sd_m.z()));
  EXPECT_GT(pose.turn_sd_deg.x(), 0.01);  // that of the prior
}

// A receiver that begins with a place of yesterday.
TEST(OnlineGeoreference, AFirstFixOfAnotherPlaceIsForgotten) {
  WalkWithFixes walk({}, 7);
  GnssFix elsewhere;
  elsewhere.stamp = WalkWithFixes::stamp(0.0);
  elsewhere.latitude_deg = 60.0;
  elsewhere.longitude_deg = 25.0;
  elsewhere.quality = 1;
  walk.online().add_fix(elsewhere, kWalkArm);
  const GlobalPose pose = walk.until(150.0);
  ASSERT_TRUE(pose.heading_known);
  EXPECT_LT(walk.error(pose).head<2>().norm(), 0.15);
}

// The same walk with an estimate that was saved and read again.
WalkWithFixes gone_on(WalkWithFixes& walk) {
  BinaryWriter saved;
  walk.online().save(saved);
  OnlineGeoreference again{OnlineGeoreferenceConfig()};
  BinaryReader reader(saved.bytes(), "state");
  again.load(reader);
  EXPECT_TRUE(reader.at_end());
  WalkWithFixes other = walk;
  other.go_on_with(again);
  return other;
}

TEST(OnlineGeoreference, TheStateIsKeptToTheBit) {
  WalkWithFixes walk({1.0, 0.3, 30.0, 0.5, true}, 8);
  (void)walk.until(33.3);
  WalkWithFixes other = gone_on(walk);
  for (int step = 0; step < 400; ++step) {
    const GlobalPose one = walk.step();
    const GlobalPose two = other.step();
    ASSERT_EQ(one.place.latitude_deg, two.place.latitude_deg) << step;
    ASSERT_EQ(one.place.height_m, two.place.height_m) << step;
    ASSERT_EQ(one.place_sd_m, two.place_sd_m) << step;
  }
}

// The carrier stands for ten seconds: only a second antenna can tell where it looks.
TEST(OnlineGeoreference, ASecondAntennaTellsTheHeadingOfACarrierThatStands) {
  TwoAntennaReceiver receiver{1.0, 0.3, 30.0, 0.5, true};
  EXPECT_FALSE(WalkWithFixes(receiver, 8).until(9.0).heading_known);
  receiver.headings = true;
  WalkWithFixes walk(receiver, 8);
  const GlobalPose pose = walk.until(9.0);
  ASSERT_TRUE(pose.heading_known);
  EXPECT_TRUE(walk.online().has_headings());
  EXPECT_FALSE(walk.online().contradicts_headings());
  EXPECT_LT(pose.turn_sd_deg.z(), 1.0);
  EXPECT_LT(std::abs(walk.error(pose)(5)), 3.0 * pose.turn_sd_deg.z());
  // And it stays right on the way.
  EXPECT_LT(std::abs(walk.error(walk.until(60.0))(5)), 1.0);
}

// Swapped antennas turn the carrier about until the way tells better.
TEST(OnlineGeoreference, HeadingsThatContradictTheWayAreLeftOut) {
  TwoAntennaReceiver receiver{0.3, 0.1, 30.0, 0.5, true};
  const GlobalPose without = WalkWithFixes(receiver, 8).until(80.0);
  receiver.headings = true;
  receiver.wrong_deg = 180.0;
  WalkWithFixes walk(receiver, 8);
  const GlobalPose pose = walk.until(80.0);
  EXPECT_TRUE(walk.online().contradicts_headings());
  ASSERT_TRUE(pose.heading_known);
  EXPECT_LT(std::abs(walk.error(pose)(5)), 5.0);
  EXPECT_EQ(pose.place.latitude_deg, without.place.latitude_deg);
}

TEST(OnlineGeoreference, GoesOnWithHeadingsWhereItStopped) {
  TwoAntennaReceiver receiver{1.0, 0.3, 30.0, 0.5, true};
  receiver.headings = true;
  WalkWithFixes walk(receiver, 8);
  (void)walk.until(23.3);
  WalkWithFixes other = gone_on(walk);
  for (int step = 0; step < 100; ++step)
    ASSERT_EQ(walk.step().turn_sd_deg.z(), other.step().turn_sd_deg.z()) << step;
}

}  // namespace
}  // namespace understory
